//! Runs a computation with the widest registers of the processor.
//!
//! The source is the same for all of them, FMA stays off, so that a·b + c is rounded twice everywhere, and no order of
//! a sum depends on a width: results have the same bits on every processor.

/// Computation that can be compiled for several sets of registers. All that it calls and that shall use the registers
/// is `#[inline(always)]`, as is its `run`.
pub trait Task {
    /// Result of the computation.
    type Output;

    /// Carries out the computation.
    fn run(self) -> Self::Output;
}

/// Runs a task with the widest registers of the processor.
pub fn widest<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    return x86::widest(task);
    #[cfg(not(target_arch = "x86_64"))]
    task.run()
}

/// Runs a task of vectors of four numbers with registers of this width, those of AVX2, if the processor has them. With
/// AVX-512 a step of a chain took a fifth to a third longer.
pub fn four_wide<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    return x86::four_wide(task);
    #[cfg(not(target_arch = "x86_64"))]
    task.run()
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "a function compiled for registers that not every processor has")]
mod x86 {
    use super::Task;

    cpufeatures::new!(avx512_detection, "avx512f");
    cpufeatures::new!(avx2_detection, "avx2");

    #[inline]
    pub fn widest<T: Task>(task: T) -> T::Output {
        if avx512_detection::get() {
            // SAFETY: the processor and the operating system have AVX-512 F.
            return unsafe { avx512(task) };
        }
        four_wide(task)
    }

    #[inline]
    pub fn four_wide<T: Task>(task: T) -> T::Output {
        if avx2_detection::get() {
            // SAFETY: the processor and the operating system have AVX2.
            return unsafe { avx2(task) };
        }
        task.run()
    }

    #[target_feature(enable = "avx512f")]
    fn avx512<T: Task>(task: T) -> T::Output {
        task.run()
    }

    #[target_feature(enable = "avx2")]
    fn avx2<T: Task>(task: T) -> T::Output {
        task.run()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of products, in lanes, of numbers that round.
    #[derive(Clone, Copy)]
    struct Products(f64);

    impl Task for Products {
        type Output = [u64; 8];

        #[inline(always)]
        fn run(self) -> [u64; 8] {
            let mut sums = [0.1; 8];
            for k in 1..1000 {
                for (lane, sum) in sums.iter_mut().enumerate() {
                    *sum = *sum * self.0 + 1.0 / (k * (lane + 3)) as f64;
                }
            }
            sums.map(f64::to_bits)
        }
    }

    /// A task that uses all registers of the processor gives results that are bit-identical to those of the plain one.
    #[test]
    fn all_registers_give_the_same_bits() {
        let task = Products(0.9);
        assert_eq!(widest(task), task.run());
        assert_eq!(four_wide(task), task.run());
    }
}
