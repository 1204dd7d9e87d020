//! Checks whether the frames of an interface reach the programs in the order of their arrival.
//!
//! A driver without NAPI hands each frame to the core that takes the interrupt (`netif_rx`). Where interrupts go to
//! several cores, the frames of a burst may overtake one another: `gs_usb` did so before Linux 6.6 (Linux commit "can:
//! gs_usb: convert to NAPI/rx-offload to avoid OoO reception", M. Kleine-Budde, 2023). Interrupts on one core keep the
//! order with every driver. The kernel has no file, stable over its versions, that lists the drivers with NAPI.

use std::fs;
use std::path::{Path, PathBuf};

use resonarm::bus::socketcan;
use resonarm::realtime::Finding;

/// Reports the order of reception of each CAN interface with hardware.
pub(super) fn findings() -> Vec<Finding> {
    let names = socketcan::interfaces().unwrap_or_default();
    names.iter().filter_map(|name| finding(Path::new("/"), name)).collect()
}

/// Reports on an interface; `None` for one without a device, such as vcan, which has no interrupts.
fn finding(root: &Path, name: &str) -> Option<Finding> {
    let subject = "order of reception";
    let device = fs::canonicalize(root.join("sys/class/net").join(name).join("device")).ok()?;
    let driver = fs::read_link(device.join("driver")).ok();
    let driver =
        driver.as_deref().and_then(Path::file_name).map_or("driver unknown".into(), |name| name.to_string_lossy());
    let Some(interrupt) = interrupt(&device) else {
        return Some(Finding { subject, state: format!("{name}: {driver}, interrupt not known"), fix: None });
    };
    let list = format!("proc/irq/{interrupt}/smp_affinity_list");
    let cores = fs::read_to_string(root.join(&list)).map_or(String::from("unknown"), |text| text.trim().to_owned());
    // The list is `2` for a single core, and `0-3` or `0,2` for several, which is no number.
    let fix = cores.parse::<usize>().is_err().then(|| {
        format!(
            "a driver without NAPI (gs_usb before Linux 6.6) lets frames of a burst overtake one another, unless one core \
             handles the interrupt: `echo 0 | sudo tee /{list}`"
        )
    });
    let state = format!("{name}: {driver}, interrupt {interrupt} on cores {cores}");
    Some(Finding { subject, state, fix })
}

/// Returns the interrupt of the device, or of the controller that it is plugged into.
fn interrupt(device: &Path) -> Option<u32> {
    let numbers = device.ancestors().map(|folder: &Path| -> PathBuf { folder.join("irq") });
    let read = |path: PathBuf| fs::read_to_string(path).ok()?.trim().parse::<u32>().ok();
    // A USB device has no `irq` file, and 0 means none. The search goes up to the host controller, whose interrupt
    // delivers the frames.
    numbers.filter_map(read).find(|number| *number > 0)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// Returns the finding on a USB adapter as the kernel shows it: the interrupt is that of the controller above it.
    fn in_words(cores: &str) -> String {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let controller = root.join("sys/devices/pci0000:00/0000:00:14.0");
        let device = controller.join("usb1/1-1:1.0");
        let interface = root.join("sys/class/net/can0");
        let interrupt = root.join("proc/irq/27");
        for folder in [&device, &interface, &interrupt] {
            fs::create_dir_all(folder).unwrap();
        }
        fs::write(controller.join("irq"), "27\n").unwrap();
        fs::write(interrupt.join("smp_affinity_list"), cores).unwrap();
        symlink(&device, interface.join("device")).unwrap();
        symlink("../../../../bus/usb/drivers/gs_usb", device.join("driver")).unwrap();
        let Finding { state, fix, .. } = finding(root, "can0").unwrap();
        format!("{state} | {}", fix.as_deref().unwrap_or("ok"))
    }

    #[test]
    fn an_adapter_whose_frames_may_overtake_is_reported_with_the_fix() {
        insta::assert_snapshot!(in_words("0-3\n"), @"can0: gs_usb, interrupt 27 on cores 0-3 | a driver without NAPI (gs_usb before Linux 6.6) lets frames of a burst overtake one another, unless one core handles the interrupt: `echo 0 | sudo tee /proc/irq/27/smp_affinity_list`");
        insta::assert_snapshot!(in_words("2\n"), @"can0: gs_usb, interrupt 27 on cores 2 | ok");
    }

    #[test]
    fn an_interface_without_hardware_has_no_interrupts() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir_all(root.path().join("sys/class/net/vcan0")).unwrap();
        assert!(finding(root.path(), "vcan0").is_none());
    }
}
