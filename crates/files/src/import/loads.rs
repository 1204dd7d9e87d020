//! Gathers the loads that commands of a user protocol request.

use std::collections::BTreeMap;

use super::wire_import::WireImport;
use resonarm_bench::node::mapped::mapping::{Action, Arming, Counts, Incoming, Mapping, ProtectionCheck, Unreadable};
use resonarm_bench::rig::Load;
use resonarm_protocol::{Frame, Id};

/// A message with loads or requests.
#[derive(Debug)]
struct Command {
    message: Incoming,
    name: String,
    protection: ProtectionCheck,
    /// The last value of each event's signal.
    values: Vec<Option<f64>>,
    load: Load,
}

/// The commanded load from sample to sample, of armed drives.
#[derive(Debug)]
pub(super) struct Loads {
    /// Whether the changes are needed.
    is_wanted: bool,
    commands: Vec<Command>,
    armed: Vec<bool>,
    pub changes: LoadChanges,
}

/// A load that changes from sample to sample.
#[derive(Debug, Default)]
pub(super) struct LoadChanges {
    /// The load from each of these samples on.
    changes: BTreeMap<u64, Load>,
    /// The load before them.
    before: Load,
}

impl LoadChanges {
    /// Sets the load from a sample on.
    pub fn insert(&mut self, sample: u64, load: Load) {
        self.changes.insert(sample, load);
    }

    /// Returns the load held from a sample on; later calls must be for later samples.
    pub fn at(&mut self, sample: u64) -> Load {
        while let Some(entry) = self.changes.first_entry().filter(|entry| *entry.key() <= sample) {
            self.before = entry.remove();
        }
        self.before
    }
}

impl Loads {
    /// Starts without a load; `is_wanted` if the changes will be asked for. Drives that no message arms count as armed.
    pub fn new(mapping: &Mapping, is_wanted: bool, name: impl Fn(Id) -> String) -> Loads {
        let drives = mapping.incoming.iter().map(|message| message.drive + 1).max().unwrap_or(1);
        let command = |message: &Incoming| Command {
            protection: ProtectionCheck::new(message.form(), &message.protection),
            name: name(message.id),
            values: vec![None; message.events.len()],
            load: Load::default(),
            message: message.clone(),
        };
        Loads {
            is_wanted,
            commands: mapping.incoming.iter().map(command).collect(),
            // Arming by the operator or by a first zero command leaves no message in the log, so such drives count as
            // armed.
            armed: vec![mapping.arming != Arming::Message; drives],
            changes: LoadChanges::default(),
        }
    }

    /// Processes a frame of sample `now`, if it is one of a command or a request.
    pub fn add(&mut self, frame: &Frame, now: u64, found: &mut WireImport) {
        let Some(place) = self.commands.iter().position(|command| command.message.id == frame.id()) else { return };
        let command = &mut self.commands[place];
        let lost = command.protection.lost(frame).ok();
        found.lost_frames += lost.unwrap_or(0);
        let Some(actions) = lost.and_then(|_| command.take(frame.data()).ok()) else {
            *found.refused_frames.entry(command.name.clone()).or_default() += 1;
            return;
        };
        let drive = command.message.drive;
        for action in actions {
            match action {
                Action::Arm => self.armed[drive] = true,
                Action::Disarm => self.drop_load(|other| other == drive),
                Action::Stop => self.drop_load(|_| true),
                Action::Reset => {}
            }
        }
        let armed = self.commands.iter().filter(|command| self.armed[command.message.drive]);
        let load = armed.fold(Load::default(), |sum, command| sum + command.load);
        if self.is_wanted {
            self.changes.insert(now, load);
        }
    }

    fn drop_load(&mut self, is_meant: impl Fn(usize) -> bool) {
        self.armed.iter_mut().enumerate().filter(|(drive, _)| is_meant(*drive)).for_each(|(_, armed)| *armed = false);
        let meant = self.commands.iter_mut().filter(|command| is_meant(command.message.drive));
        meant.for_each(|command| command.load = Load::default());
    }
}

impl Command {
    /// Processes a load, and returns the actions that the payload requests.
    ///
    /// # Errors
    /// [`Unreadable`] if a signal can't be read: the plant then rejects the frame with all of its requests.
    fn take(&mut self, payload: &[u8]) -> Result<Vec<Action>, Unreadable> {
        self.message.check(payload)?;
        let mut actions = Vec::new();
        for (event, before) in self.message.events.iter().zip(&mut self.values) {
            let Some(signal) = &event.signal else {
                actions.extend(event.actions.iter().map(|(_, action)| *action));
                continue;
            };
            let Some(value) = signal.read(payload)? else { continue };
            let is_new = before.replace(value) != Some(value) || event.counts == Counts::InEveryFrame;
            let asked = event.actions.iter().filter(|(asking, _)| is_new && *asking == value);
            actions.extend(asked.map(|(_, action)| *action));
        }
        self.load = self.message.load(payload)?.unwrap_or(self.load);
        Ok(actions)
    }
}
