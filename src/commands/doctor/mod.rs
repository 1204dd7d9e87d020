//! `resonarm doctor`: the abilities of this machine, and how to add those that are missing.

mod queues;
mod reception;

use std::collections::BTreeMap;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use resonarm::bus::socketcan;
use resonarm::realtime::{Finding, Privileges};

/// Checks CAN, real-time privileges and clock of this machine, and says how to fix them.
#[derive(Debug, Args)]
pub(crate) struct Doctor {
    #[command(flatten)]
    json: JsonFlag,
}

impl Doctor {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut findings = vec![can(), interfaces(), python_can(), live()];
        findings.extend(queues::findings());
        findings.extend(reception::findings());
        findings.extend(Privileges::probe().findings());
        self.json.show(&BTreeMap::from([("findings", &findings)]), || in_words(&findings), &[])
    }
}

/// Lists the findings for people, with the fixes.
pub(crate) fn in_words(findings: &[Finding]) -> String {
    let mut text = String::new();
    for Finding { subject, state, fix } in findings {
        let mark = if fix.is_none() { "ok  " } else { "fix " };
        text += &format!("{mark}  {subject:21} {state}\n");
        if let Some(fix) = fix {
            text += &format!("      {:21} {fix}\n", "");
        }
    }
    text
}

fn finding(subject: &'static str, state: impl Into<String>, fix: Option<String>) -> Finding {
    Finding { subject, state: state.into(), fix }
}

fn can() -> Finding {
    match socketcan::supported() {
        Ok(()) => finding("SocketCAN", "supported by the kernel", None),
        Err(error) => finding("SocketCAN", "not available", Some(error.to_string())),
    }
}

fn interfaces() -> Finding {
    let create = "`sudo ip link add vcan0 type vcan && sudo ip link set vcan0 mtu 72 up` makes a virtual one";
    let (state, is_missing) = match socketcan::interfaces() {
        // A machine may have CAN and no interface yet.
        Ok(names) if names.is_empty() => (String::from("none"), true),
        Ok(names) => (names.join(", "), false),
        Err(error) => (error.to_string(), true),
    };
    finding("CAN interfaces", state, is_missing.then(|| String::from(create)))
}

/// Names what `python-can:` would load, without running any of it.
#[cfg(feature = "python-can")]
fn python_can() -> Finding {
    match resonarm::bus::python_can::would_load() {
        Ok(found) => finding("python-can", format!("in this build; {found}"), None),
        Err(error) => finding("python-can", "in this build, but not available", Some(error.to_string())),
    }
}

#[cfg(not(feature = "python-can"))]
fn python_can() -> Finding {
    let fix = "`cargo build --release --features python-can` makes a build that reaches its adapters";
    finding("python-can", "not in this build", Some(String::from(fix)))
}

/// Reports whether this build has the live view.
fn live() -> Finding {
    if cfg!(feature = "live") {
        return finding("live view", "in this build", None);
    }
    let fix = "`cargo build --release --features live` makes a build with --live";
    finding("live view", "not in this build", Some(String::from(fix)))
}
