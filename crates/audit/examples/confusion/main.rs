//! Do the cases of the audit find the controllers they are meant to find, and no others?
//!
//! `cargo run --release -p resonarm-audit --example confusion [SEEDS [FIRST [NAME …]]]` audits correct and flawed controllers of
//! random tests, sines and shocks on three structures, with SEEDS seeds from the seed FIRST on (20 from 1), and prints a table
//! for each structure: for how many seeds a case failed, for how many the case that is meant to find the flaw did, which others
//! failed, and which cases decided nothing. NAME selects controllers and structures. Of a single seed the figures of the cases
//! that did not pass follow each row. Behind the table are the sums of both kinds of controllers.
#![allow(clippy::print_stdout, clippy::panic, clippy::unwrap_used, reason = "a program that measures")]

mod bench;
mod plant;
mod random_loop;
mod reference;
mod shock_loop;
mod sine_loop;

use std::collections::BTreeMap;
use std::ops::Range;

use bench::{Audit, specification};
use plant::{STRUCTURES, Structure};
use random_loop::RandomLoop;
use reference::Reference;
use resonarm_audit::{Base, Case, Context, Finding, Verdict, cases};
use resonarm_specification::Specification;
use sine_loop::SineLoop;

fn main() -> Result<(), String> {
    let mut arguments = std::env::args().skip(1);
    let number = |argument: Option<String>, absent: u64| {
        argument.map_or(Ok(absent), |text| text.parse().map_err(|error| format!("{text}: {error}")))
    };
    let count = number(arguments.next(), 20)?;
    let first = number(arguments.next(), 1)?;
    let names: Vec<String> = arguments.collect();
    let is_named = |of: &str| names.is_empty() || names.iter().any(|name| of.contains(name.as_str()));
    let seeds = first..first + count;
    let [random, shock] = [random_loop::SPECIFICATION, shock_loop::SPECIFICATION].map(specification);
    let (random, shock) = (random?, shock?);
    for structure in &STRUCTURES {
        println!("\n{}, {count} seeds from {first} on\n", structure.name);
        println!("| controller | failed | by the case meant | by others | undecided |");
        println!("| --- | ---: | --- | --- | --- |");
        let mut sums = [Sum::default(), Sum::default()];
        let sine = specification(&sine_loop::text(&structure.sweep))?;
        for (kind, specification) in [("random", &random), ("sine", &sine), ("shock", &shock)] {
            let name = format!("{kind}: correct, reference controller");
            if is_named(&format!("{} {name}", structure.name)) {
                sums[0].add(row(&name, &[], seeds.clone(), |seed| {
                    let controller = |specification: &Specification| Reference::new(specification, seed);
                    Audit { structure, specification, seed, controller: &controller }.judge(&[])
                }));
            }
        }
        for (flaw, name, meant) in random_loop::CONTROLLERS {
            let name = format!("random: {name}");
            if !is_named(&format!("{} {name}", structure.name)) {
                continue;
            }
            sums[usize::from(!meant.is_empty())].add(row(&name, meant, seeds.clone(), |seed| {
                let controller = |specification: &Specification| RandomLoop::new(specification, *flaw, seed);
                let audit = Audit { structure, specification: &random, seed, controller: &controller };
                audit.judge(&[])
            }));
        }
        for (flaw, name, meant) in sine_loop::CONTROLLERS {
            let name = format!("sine: {name}");
            if !is_named(&format!("{} {name}", structure.name)) {
                continue;
            }
            sums[usize::from(!meant.is_empty())].add(row(&name, meant, seeds.clone(), |seed| {
                let controller =
                    |specification: &Specification| SineLoop::new(specification, structure.sweep.gain_1_s, *flaw);
                let audit = Audit { structure, specification: &sine, seed, controller: &controller };
                audit.judge(&[])
            }));
        }
        for (flaw, name, meant) in shock_loop::CONTROLLERS {
            let name = format!("shock: {name}");
            if !is_named(&format!("{} {name}", structure.name)) {
                continue;
            }
            let sum = row(&name, meant, seeds.clone(), |seed| shocks(structure, &shock, *flaw, seed));
            sums[usize::from(!meant.is_empty())].add(sum);
        }
        let [correct, flawed] = sums;
        println!("\n{} of {} audits of correct controllers failed,", correct.failed, correct.audits);
        let Sum { audits, failed, found } = flawed;
        println!("{failed} of {audits} of flawed ones, {found} by a case that is meant to find the flaw.");
    }
    Ok(())
}

/// Judges a run of shots.
fn shocks(
    structure: &Structure,
    specification: &Specification,
    flaw: shock_loop::ShockFlaw,
    seed: u64,
) -> Vec<(&'static Case, Finding)> {
    let record = shock_loop::run(structure, specification, flaw, seed);
    let base = Base::new(specification, &record);
    let context = Context { specification, base: &base, record: &record, stimulus: 0 };
    cases(&specification.test).iter().map(|case| (case, case.judge(&context))).collect()
}

/// Audits, those in which a case failed, and those in which the case that is meant to find the flaw did.
#[derive(Clone, Copy, Default)]
struct Sum {
    audits: u32,
    failed: u32,
    found: u32,
}

impl Sum {
    fn add(&mut self, other: Sum) {
        self.audits += other.audits;
        self.failed += other.failed;
        self.found += other.found;
    }
}

/// Prints the row of a controller: its verdicts over the seeds.
fn row(
    name: &str,
    meant: &[&str],
    seeds: Range<u64>,
    judge: impl Fn(u64) -> Vec<(&'static Case, Finding)> + Sync,
) -> Sum {
    let mut sum = Sum::default();
    let [mut others, mut undecided] = [BTreeMap::new(), BTreeMap::new()];
    let is_single = seeds.end - seeds.start == 1;
    let mut figures = Vec::new();
    let judge = &judge;
    let judged: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = seeds.map(|seed| scope.spawn(move || judge(seed))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    for verdicts in judged {
        let fails: Vec<&str> =
            verdicts.iter().filter(|(_, found)| found.verdict == Verdict::Failed).map(|(case, _)| case.id).collect();
        sum.add(Sum {
            audits: 1,
            failed: u32::from(!fails.is_empty()),
            found: u32::from(fails.iter().any(|case| meant.contains(case))),
        });
        for case in fails.iter().filter(|case| !meant.contains(case)) {
            *others.entry(*case).or_insert(0) += 1;
        }
        for (case, finding) in verdicts {
            if matches!(finding.verdict, Verdict::Inconclusive(_) | Verdict::Skipped(_)) {
                *undecided.entry(case.id).or_insert(0) += 1;
            }
            if is_single && finding.verdict != Verdict::Passed {
                figures.push(format!("{} {finding:?}", case.id));
            }
        }
    }
    let list = |cases: &BTreeMap<&str, u32>| -> String {
        cases.iter().map(|(case, count)| format!("{case} {count}")).collect::<Vec<_>>().join(", ")
    };
    let meant = if meant.is_empty() { String::from("–") } else { format!("{} {}", meant.join(" or "), sum.found) };
    println!("| {name} | {} | {meant} | {} | {} |", sum.failed, list(&others), list(&undecided));
    figures.iter().for_each(|figure| println!("{figure}"));
    sum
}
