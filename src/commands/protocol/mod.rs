//! `resonarm protocol`: the specification, DBC and C header of the protocol, decoding and encoding of frames, the EDS
//! of drives.

mod decode;
mod eds;
mod encode;

use clap::{Args, Subcommand};

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::{flags, numbers, output};
use resonarm::protocol::{DEFAULT_BASE, Network, Node, Profile, SPEC, dbc, header};

/// Prints the specification, DBC, C header or EDS; decodes and encodes frames.
#[derive(Debug, Args)]
pub(crate) struct Protocol {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Prints the specification, in Markdown.
    Spec,
    /// Prints the DBC of a network, for cantools, SavvyCAN, Vector's tools and the like.
    Dbc(NetworkFlags),
    /// Prints the C header of a network: identifiers, data ids, lengths, scaling, times, hash of the DBC.
    Header(NetworkFlags),
    Decode(decode::Decode),
    Eds(eds::Eds),
    Encode(encode::Encode),
}

/// Which network.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::NETWORK)]
pub(crate) struct NetworkFlags {
    /// Base identifier, a multiple of 0x10 from 0x180 to 0x570.
    #[arg(long, value_name = "ID", value_parser = identifier, default_value_t = Hexadecimal(DEFAULT_BASE))]
    base: Hexadecimal,
    /// Node id of the plant, from 1 to 127.
    #[arg(long, value_name = "N", value_parser = numbers::integer_checked_later(1..=127_u8), default_value_t = Network::default().node_id(Node::Plant))]
    plant_id: u8,
    /// Node id of the exciter, from 1 to 127.
    #[arg(long, value_name = "N", value_parser = numbers::integer_checked_later(1..=127_u8), default_value_t = Network::default().node_id(Node::Exciter))]
    exciter_id: u8,
    /// Frames of commands and samples: classic CAN or CAN FD.
    #[arg(long, value_parser = flags::one_of(Profile::ALL, Profile::name), default_value_t)]
    profile: Profile,
}

/// A number that the help shows in hexadecimal.
#[derive(Clone, Copy, Debug)]
struct Hexadecimal(u16);

impl core::fmt::Display for Hexadecimal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:#x}", self.0)
    }
}

/// Parses a number, decimal or, after 0x, hexadecimal.
fn identifier(text: &str) -> Result<Hexadecimal, String> {
    let number = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(digits) => u16::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map(Hexadecimal).map_err(|_error| String::from("it must be an identifier, as 0x200 or 512"))
}

impl NetworkFlags {
    pub fn network(&self) -> Result<Network, Failure> {
        Network::new(self.base.0)
            .and_then(|network| network.with_node_ids(self.plant_id, self.exciter_id))
            .map(|network| network.with_profile(self.profile))
            .map_err(|error| Failure::usage(error.to_string()))
    }
}

impl Protocol {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let text = match &self.action {
            Action::Spec => SPEC.to_owned(),
            Action::Dbc(flags) => dbc::Dbc(flags.network()?).to_string(),
            Action::Header(flags) => header::Header(flags.network()?).to_string(),
            Action::Decode(decode) => return decode.execute(),
            Action::Eds(eds) => return eds.execute(),
            Action::Encode(encode) => return encode.execute(),
        };
        output::print(&text)?;
        Ok(Verdict::Positive)
    }
}
