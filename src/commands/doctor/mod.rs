//! `resonarm doctor`: the abilities of this machine, and how to add those that are missing.

mod queues;
mod reception;

use clap::Args;
use serde::Serialize;

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

#[derive(Serialize)]
struct Document {
    findings: Vec<Finding>,
}

impl Doctor {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut findings = vec![can(), interfaces(), python_can(), live()];
        findings.extend(queues::findings());
        findings.extend(reception::findings());
        findings.extend(Privileges::probe().findings());
        let document = Document { findings };
        self.json.show(&document, || in_words(&document.findings), &[])
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

fn can() -> Finding {
    let subject = "SocketCAN";
    match socketcan::supported() {
        Ok(()) => Finding { subject, state: String::from("supported by the kernel"), fix: None },
        Err(error) => Finding { subject, state: String::from("not available"), fix: Some(error.to_string()) },
    }
}

fn interfaces() -> Finding {
    let subject = "CAN interfaces";
    let create = "`sudo ip link add vcan0 type vcan && sudo ip link set vcan0 mtu 72 up` makes a virtual one";
    match socketcan::interfaces() {
        Ok(names) if names.is_empty() => {
            Finding { subject, state: String::from("none"), fix: Some(String::from(create)) }
        }
        Ok(names) => Finding { subject, state: names.join(", "), fix: None },
        Err(error) => Finding { subject, state: error.to_string(), fix: Some(String::from(create)) },
    }
}

/// Names what `python-can:` would load, without running any of it.
#[cfg(feature = "python-can")]
fn python_can() -> Finding {
    let subject = "python-can";
    match resonarm::bus::python_can::would_load() {
        Ok(found) => Finding { subject, state: format!("in this build; {found}"), fix: None },
        Err(error) => {
            Finding { subject, state: String::from("in this build, but not available"), fix: Some(error.to_string()) }
        }
    }
}

#[cfg(not(feature = "python-can"))]
fn python_can() -> Finding {
    let fix = "`cargo build --release --features python-can` makes a build that reaches its adapters";
    Finding { subject: "python-can", state: String::from("not in this build"), fix: Some(String::from(fix)) }
}

/// Reports whether this build has the live view.
fn live() -> Finding {
    let subject = "live view";
    if cfg!(feature = "live") {
        return Finding { subject, state: String::from("in this build"), fix: None };
    }
    let fix = "`cargo build --release --features live` makes a build with --live";
    Finding { subject, state: String::from("not in this build"), fix: Some(String::from(fix)) }
}
