//! The Protobuf messages of states, loads and readings, made from the table of channels.
//!
//! A batch is `first_step` (1), `dt_s` (2), a mark (3) and one packed column for each channel from field 4 on, in the
//! order of the table. The messages for plotting number their channels alike. A reader goes by the names in the schema.

use prost::bytes::{Buf, BufMut};
use prost::encoding::{self, DecodeContext, WireType};
use prost::{DecodeError, Message};
use thiserror::Error;

use super::channels::Channels;
use super::schema::Topic;
use resonarm_bench::structure::{
    Channel, ChannelName, Kind, LoadSet, NATIVE_LOADS, Point, READINGS, known_states, named_sensor_channels,
};

/// Fields of every message.
pub(super) const STEP: u32 = 1;
pub(super) const DT_S: u32 = 2;
const MARK: u32 = 3;
/// The field of the first channel.
const FIRST: u32 = 4;

/// The part of `google/protobuf/descriptor.proto` that the schemas use.
mod descriptor {
    pub const OPTIONAL: i32 = 1;
    pub const REPEATED: i32 = 3;
    pub const DOUBLE: i32 = 1;
    pub const UINT64: i32 = 4;
    pub const BOOL: i32 = 8;
    pub const UINT32: i32 = 13;

    #[derive(Clone, PartialEq, prost::Message)]
    pub struct FileSet {
        #[prost(message, repeated, tag = "1")]
        pub files: Vec<File>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub struct File {
        #[prost(string, tag = "1")]
        pub name: String,
        #[prost(string, tag = "2")]
        pub package: String,
        #[prost(message, repeated, tag = "4")]
        pub messages: Vec<Type>,
        #[prost(string, tag = "12")]
        pub syntax: String,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub struct Type {
        #[prost(string, tag = "1")]
        pub name: String,
        #[prost(message, repeated, tag = "2")]
        pub fields: Vec<Field>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub struct Field {
        #[prost(string, tag = "1")]
        pub name: String,
        #[prost(int32, tag = "3")]
        pub number: i32,
        #[prost(int32, tag = "4")]
        pub label: i32,
        #[prost(int32, tag = "5")]
        pub kind: i32,
    }
}

use descriptor::{BOOL, DOUBLE, Field, File, FileSet, OPTIONAL, REPEATED, Type, UINT32, UINT64};

/// Returns the channels of a message with the numbers of their fields.
fn numbered(topic: Topic, channels: &Channels) -> impl Iterator<Item = (u32, &Channel)> {
    // The messages for plotting repeat the numbers of these two, a part of them each.
    let whole = match topic {
        Topic::State | Topic::Command => Topic::States,
        Topic::Sensors => Topic::Samples,
        topic => topic,
    };
    let is_in = move |channel: &Channel| match topic {
        Topic::State => matches!(channel.kind, Kind::State | Kind::Internal),
        Topic::Command => channel.kind == Kind::Load,
        _ => true,
    };
    (FIRST..).zip(channels.of(whole)).filter(move |(_, channel)| is_in(channel))
}

impl Topic {
    /// Returns its schema: a serialised `google.protobuf.FileDescriptorSet`, as MCAP requires.
    pub fn descriptor(self, channels: &Channels) -> Vec<u8> {
        match self {
            Topic::Frames => include_bytes!("../../proto/descriptors/frame_batch.bin").into(),
            Topic::Ticks => include_bytes!("../../proto/descriptors/tick_batch.bin").into(),
            Topic::Events => include_bytes!("../../proto/descriptors/event.bin").into(),
            of => schema(of, channels),
        }
    }
}

/// Returns the schema of a message of states, loads or readings: a serialised `google.protobuf.FileDescriptorSet`.
fn schema(topic: Topic, channels: &Channels) -> Vec<u8> {
    let is_batch = matches!(topic, Topic::States | Topic::Samples);
    let label = if is_batch { REPEATED } else { OPTIONAL };
    let field =
        |name: &str, number: u32, label, kind| Field { name: name.to_owned(), number: number as i32, label, kind };
    let mut fields = match is_batch {
        true => vec![field("first_step", STEP, OPTIONAL, UINT64), field("dt_s", DT_S, OPTIONAL, DOUBLE)],
        false => vec![field("step", STEP, OPTIONAL, UINT64)],
    };
    match topic {
        Topic::States => fields.push(field("last_row_is_end", MARK, OPTIONAL, BOOL)),
        Topic::Samples | Topic::Sensors => fields.push(field("clipped", MARK, label, UINT32)),
        _ => {}
    }
    fields.extend(numbered(topic, channels).map(|(number, of)| field(&of.name, number, label, DOUBLE)));
    let name = topic.schema_name();
    let (package, name) = name.rsplit_once('.').unwrap_or(("", name));
    let messages = vec![Type { name: name.to_owned(), fields }];
    let file = format!("{}.proto", name.to_lowercase());
    let package = package.to_owned();
    let syntax = String::from("proto3");
    FileSet { files: vec![File { name: file, package, messages, syntax }] }.encode_to_vec()
}

/// Error of the channels of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ChannelsError {
    /// The schema is invalid.
    #[error("a schema that can't be read: {cause}")]
    Schema {
        /// Error in the schema, in words.
        cause: String,
    },
    /// This version does not know a channel.
    #[error("channel `{name}`, which this version does not know")]
    Unknown {
        /// Name of the unknown channel.
        name: String,
    },
    /// A channel is missing.
    #[error("no channel `{name}`")]
    Missing {
        /// Name of the missing channel.
        name: String,
    },
    /// Two channels have the same name or field.
    #[error("channel `{name}` twice, or two channels in its field")]
    Doubled {
        /// Name of the two channels.
        name: String,
    },
    /// A field has another type than expected.
    #[error("field `{name}` of an unexpected type")]
    Type {
        /// Name of the field with the other type.
        name: String,
    },
}

/// Positions of the channels in a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Channels in the order of the table.
    pub(super) channels: Vec<Channel>,
    /// The field of each channel.
    pub(super) fields: Vec<u32>,
    pub(super) mark: u32,
    /// Number of channels that are coordinates and rates.
    pub(super) moving: usize,
    /// The loads among the channels.
    pub(super) taken: LoadSet,
}

impl Layout {
    fn of(channels: Vec<Channel>, fields: Vec<u32>, mark: u32) -> Layout {
        let moving = channels.iter().filter(|channel| channel.kind == Kind::State).count();
        // Channels are in the order of the table.
        let loads = channels.iter().filter(|channel| channel.kind == Kind::Load);
        let taken = LoadSet::of_channels(loads).unwrap_or(LoadSet::NATIVE);
        Layout { channels, fields, mark, moving, taken }
    }

    /// The layout in which a message is written.
    pub fn new(channels: &Channels, topic: Topic) -> Layout {
        let (fields, channels) = numbered(topic, channels).unzip();
        let channels: Vec<&Channel> = channels;
        Layout::of(channels.into_iter().copied().collect(), fields, MARK)
    }

    /// Reads the layout from the schema of a batch.
    ///
    /// # Errors
    /// [`ChannelsError`] if the schema is damaged, or has other channels than the table.
    pub fn read(topic: Topic, schema: &[u8]) -> Result<Layout, ChannelsError> {
        let set = FileSet::decode(schema).map_err(|error| ChannelsError::Schema { cause: error.to_string() })?;
        let mut types = set.files.iter().flat_map(|file| file.messages.iter().map(move |of| (&file.package, of)));
        let found = types.find(|(package, of)| format!("{package}.{}", of.name) == topic.schema_name());
        let missing = || ChannelsError::Schema { cause: format!("it has no message `{}`", topic.schema_name()) };
        let found = &found.ok_or_else(missing)?.1.fields;
        let (known, mark_name, mark_type) = match topic {
            Topic::States => (known_states(), "last_row_is_end", (OPTIONAL, BOOL)),
            _ => (readings(found)?, "clipped", (REPEATED, UINT32)),
        };
        let mut mark = None;
        let mut places = vec![None; known.len()];
        let mut numbers = Vec::new();
        for Field { name, number, label, kind } in found {
            let number = u32::try_from(*number).map_err(|_| ChannelsError::Type { name: name.clone() })?;
            let (place, expected) = match name.as_str() {
                "first_step" => (None, (OPTIONAL, UINT64)),
                "dt_s" => (None, (OPTIONAL, DOUBLE)),
                of if of == mark_name => (Some(&mut mark), mark_type),
                of => match known.iter().position(|channel| channel.name == of) {
                    Some(place) => (Some(&mut places[place]), (REPEATED, DOUBLE)),
                    None => return Err(ChannelsError::Unknown { name: name.clone() }),
                },
            };
            // `NumberBatch` reads these two by their fixed fields, whatever the schema says. All other fields are
            // found by name.
            let is_reserved = name == "first_step" && number != STEP || name == "dt_s" && number != DT_S;
            if (*label, *kind) != expected || is_reserved {
                return Err(ChannelsError::Type { name: name.clone() });
            }
            if numbers.contains(&number) || place.is_some_and(|place| place.replace(number).is_some()) {
                return Err(ChannelsError::Doubled { name: name.clone() });
            }
            numbers.push(number);
        }
        let mark = mark.ok_or_else(|| ChannelsError::Missing { name: mark_name.to_owned() })?;
        if let Some(name) = missing_channel(&known, |place| places[place].is_some()) {
            return Err(ChannelsError::Missing { name: name.as_str().to_owned() });
        }
        let (channels, fields) =
            known.iter().zip(places).filter_map(|(channel, place)| Some((*channel, place?))).unzip();
        Ok(Layout::of(channels, fields, mark))
    }
}

/// Returns the channels of the readings in a batch: those of every rig, then those of other sensors in the order of
/// their fields.
fn readings(fields: &[Field]) -> Result<Vec<Channel>, ChannelsError> {
    let is_other = |field: &&Field| {
        let name = field.name.as_str();
        !["first_step", "dt_s", "clipped"].contains(&name) && READINGS.iter().all(|channel| channel.name != name)
    };
    let mut others: Vec<&Field> = fields.iter().filter(is_other).collect();
    // The order of the fields in a schema is free. The recorder numbers them in the order of the channels.
    others.sort_by_key(|field| field.number);
    let names: Vec<&str> = others.iter().map(|field| field.name.as_str()).collect();
    let others = named_sensor_channels(&names).map_err(|name| ChannelsError::Unknown { name: name.to_owned() })?;
    Ok([&READINGS[..], &others].concat())
}

/// Returns the first channel that a recording lacks: a native load, a reading, a coordinate or a rate up to the last
/// joint, mode or displacement of which there is a state. Without any state it is the first of the arm.
fn missing_channel(known: &[Channel], is_there: impl Fn(usize) -> bool) -> Option<ChannelName> {
    let of_motion = || known.iter().enumerate().filter(|(_, of)| of.kind == Kind::State);
    let last = |coordinates| {
        let there = of_motion().filter(|(place, of)| of.coordinates() == coordinates && is_there(*place));
        there.map(|(_, of)| of.point.node()).max()
    };
    let has_none = of_motion().all(|(place, _)| !is_there(place));
    let is_needed = |channel: &Channel| match channel.kind {
        Kind::Load => NATIVE_LOADS.contains(channel),
        Kind::Reading { .. } => true,
        Kind::Internal => false,
        Kind::State if has_none => channel.point == Point::Joint1,
        Kind::State => last(channel.coordinates()).is_some_and(|node| channel.point.node() <= node),
    };
    known.iter().enumerate().find(|(place, of)| is_needed(of) && !is_there(*place)).map(|(_, of)| of.name)
}

/// A message for plotting: the numbers of one sample.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Topic of the message.
    pub topic: Topic,
    /// The sample that it describes.
    pub sample: u64,
    clipped: u32,
    numbers: Vec<(u32, f64)>,
}

impl Plot {
    /// Makes the message of a row: the numbers of the row, in the order of the table, that the message has.
    pub fn new(topic: Topic, channels: &Channels, sample: u64, row: &[f64], clipped: u32) -> Plot {
        let fields = numbered(topic, channels).map(|(field, _)| field);
        let numbers = fields.filter_map(|field| Some((field, *row.get((field - FIRST) as usize)?))).collect();
        Plot { topic, sample, clipped, numbers }
    }
}

/// Leaves out zeros, as proto3 does.
impl Message for Plot {
    fn encode_raw(&self, buf: &mut impl BufMut) {
        if self.sample != 0 {
            encoding::uint64::encode(STEP, &self.sample, buf);
        }
        if self.clipped != 0 {
            encoding::uint32::encode(MARK, &self.clipped, buf);
        }
        for (field, value) in self.numbers.iter().filter(|(_, value)| *value != 0.0) {
            encoding::double::encode(*field, value, buf);
        }
    }

    fn merge_field(
        &mut self,
        tag: u32,
        wire: WireType,
        buf: &mut impl Buf,
        context: DecodeContext,
    ) -> Result<(), DecodeError> {
        // These messages are only written. A reader takes the samples from the batches, which have every one of them
        // unfiltered.
        encoding::skip_field(wire, tag, buf, context)
    }

    fn encoded_len(&self) -> usize {
        let numbers = self.numbers.iter().filter(|(_, value)| *value != 0.0);
        let step = if self.sample == 0 { 0 } else { encoding::uint64::encoded_len(STEP, &self.sample) };
        let mark = if self.clipped == 0 { 0 } else { encoding::uint32::encoded_len(MARK, &self.clipped) };
        step + mark + numbers.map(|(field, value)| encoding::double::encoded_len(*field, value)).sum::<usize>()
    }

    fn clear(&mut self) {
        self.sample = 0;
        self.clipped = 0;
        self.numbers.clear();
    }
}
