//! Runs a computation with the widest registers of the processor.
//!
//! The source is the same for all of them, and FMA stays off: a·b + c is rounded twice everywhere, and no order of a sum
//! depends on a width. So results have the same bits on every processor.

/// A computation. All that it calls and that shall use the registers is `#[inline(always)]`, as is its `run`.
pub(crate) trait Task {
    /// Its result.
    type Output;

    /// Computes it.
    fn run(self) -> Self::Output;
}

/// Runs a task with the widest registers of the processor.
pub(crate) fn widest<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if x86::has_avx512() {
            return x86::with_avx512(task);
        }
        if x86::has_avx2() {
            return x86::with_avx2(task);
        }
    }
    task.run()
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Task;

    cpufeatures::new!(avx512_detection, "avx512f");
    cpufeatures::new!(avx2_detection, "avx2");

    /// Whether processor and operating system have AVX-512 F; queried once.
    pub fn has_avx512() -> bool {
        avx512_detection::get()
    }

    /// Whether they have AVX2.
    pub fn has_avx2() -> bool {
        avx2_detection::get()
    }

    #[allow(unsafe_code)]
    pub fn with_avx512<T: Task>(task: T) -> T::Output {
        // SAFETY: `widest` comes here only where the processor says that it has AVX-512 F.
        unsafe { avx512(task) }
    }

    #[target_feature(enable = "avx512f")]
    fn avx512<T: Task>(task: T) -> T::Output {
        task.run()
    }

    #[allow(unsafe_code)]
    pub fn with_avx2<T: Task>(task: T) -> T::Output {
        // SAFETY: `widest` comes here only where the processor says that it has AVX2.
        unsafe { avx2(task) }
    }

    #[target_feature(enable = "avx2")]
    fn avx2<T: Task>(task: T) -> T::Output {
        task.run()
    }
}
