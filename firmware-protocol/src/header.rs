//! The C header of a network, which `c/include/resonarm.h` includes.

use core::fmt;

use crate::e2e::MAX_DELTA_COUNTER;
use crate::kind::MessageKind;
use crate::message::{Hello, PROTOCOL_VERSION};
use crate::network::{BASE_MAX, BASE_MIN, NODE_ID_MAX, Network, Node, Profile};
use crate::{dbc, scaling, timing};

/// The C header of a network: the numbers of the protocol, the network's own, and of each message identifier, data id
/// and length. That of the default network is `c/include/resonarm_config.h`.
#[derive(Clone, Copy, Debug)]
pub struct Header(pub Network);

impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let network = self.0;
        let [plant_id, exciter_id] = Node::ALL.map(|node| network.node_id(node));
        let base = network.base();
        let profile = network.profile();
        writeln!(
            f,
            "/**\n * @file resonarm_config.h\n * @brief The numbers of the Resonarm protocol, and of the network with base \
             {base:#05X}, plant {plant_id}, exciter {exciter_id}, {profile}.\n *\n * Written by `resonarm protocol \
             header`, which writes that of another network, too. */"
        )?;
        f.write_str("#ifndef RESONARM_CONFIG_H\n#define RESONARM_CONFIG_H\n\n#include <stdint.h>\n")?;
        protocol(f)?;
        times(f)?;
        f.write_str("\n/** @name This network */\n/**@{*/\n")?;
        writeln!(f, "#define RESONARM_BASE {base:#05X}u")?;
        writeln!(f, "#define RESONARM_PLANT_ID {plant_id}u")?;
        writeln!(f, "#define RESONARM_EXCITER_ID {exciter_id}u")?;
        let name = match profile {
            Profile::Classic => "CLASSIC",
            Profile::Fd => "FD",
        };
        writeln!(f, "#define RESONARM_PROFILE RESONARM_PROFILE_{name}\n/**@}}*/")?;
        f.write_str(
            "\n/** @name Messages of this network\n * Identifier, E2E data id (0: not protected), and bytes (0: not in \
             this profile). */\n/**@{*/\n",
        )?;
        for kind in MessageKind::ALL {
            message(f, network, kind)?;
        }
        f.write_str("/**@}*/\n\n#endif\n")
    }
}

/// The definitions common to all networks.
fn protocol(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let hash = |profile| dbc::hash(profile) & Hello::DBC_HASH_MASK;
    f.write_str("\n/** @name Protocol */\n/**@{*/\n")?;
    f.write_str("/** Version: major in the high nibble, minor in the low one (section 4, hello). */\n")?;
    writeln!(f, "#define RESONARM_PROTOCOL_VERSION {PROTOCOL_VERSION:#04X}u")?;
    f.write_str("/** Low 24 bits of the CRC-32 of resonarm.dbc, as a hello of the classic profile carries them. */\n")?;
    writeln!(f, "#define RESONARM_DBC_HASH_CLASSIC {:#08X}u", hash(Profile::Classic))?;
    f.write_str("/** The same of resonarm-fd.dbc, for the FD profile. */\n")?;
    writeln!(f, "#define RESONARM_DBC_HASH_FD {:#08X}u", hash(Profile::Fd))?;
    f.write_str("/** The classic profile's counts (section 3). */\n")?;
    // Without the suffix u: counts are signed, and in C an unsigned factor would make the product unsigned.
    writeln!(f, "#define RESONARM_COUNT_MAX {}", scaling::RAW_MAX)?;
    writeln!(f, "#define RESONARM_COUNTS_PER_N {}", scaling::FORCE.counts_per_unit())?;
    writeln!(f, "#define RESONARM_COUNTS_PER_NM {}", scaling::TORQUE.counts_per_unit())?;
    writeln!(f, "#define RESONARM_COUNTS_PER_M_S2 {}", scaling::ACCELERATION.counts_per_unit())?;
    f.write_str("/** Largest step of an E2E counter that a receiver takes (section 2). */\n")?;
    writeln!(f, "#define RESONARM_MAX_DELTA_COUNTER {MAX_DELTA_COUNTER}u")?;
    f.write_str("/** Possible networks (section 1). */\n")?;
    writeln!(f, "#define RESONARM_BASE_MIN {BASE_MIN:#05X}u")?;
    writeln!(f, "#define RESONARM_BASE_MAX {BASE_MAX:#05X}u")?;
    writeln!(f, "#define RESONARM_NODE_ID_MAX {NODE_ID_MAX}u\n/**@}}*/")
}

fn times(f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let ns = [
        ("HEARTBEAT_PERIOD", timing::HEARTBEAT_PERIOD_NS),
        ("HEARTBEAT_TIMEOUT", timing::HEARTBEAT_TIMEOUT_NS),
        ("HELLO_PERIOD", timing::HELLO_PERIOD_NS),
        ("COMMAND_TIMEOUT", timing::COMMAND_TIMEOUT_NS),
        ("COMMAND_AGE", timing::COMMAND_AGE_NS),
        ("FORCE_RAMP", timing::FORCE_RAMP_NS),
        ("LOCKSTEP_TIMEOUT", timing::LOCKSTEP_TIMEOUT_NS),
        ("LOCKSTEP_LOOK", timing::LOCKSTEP_LOOK_NS),
    ];
    f.write_str("\n/** @name Times of section 6, ns, and limits of section 8 */\n/**@{*/\n")?;
    for (name, time_ns) in ns {
        // 64 bits, since C would compute with an int otherwise, and 32 bits end at 4.3 s.
        writeln!(f, "#define RESONARM_{name}_NS UINT64_C({time_ns})")?;
    }
    f.write_str("/** Lowest sample rate in real time, Hz. */\n")?;
    writeln!(f, "#define RESONARM_REAL_TIME_RATE_MIN_HZ {}u", timing::REAL_TIME_RATE_MIN_HZ)?;
    f.write_str("/** How many samples of a repeated or older index make a fault, counted from arming. */\n")?;
    writeln!(f, "#define RESONARM_STALE_SAMPLES_LIMIT {}u", timing::STALE_SAMPLES_LIMIT)?;
    f.write_str("/** Smallest window of the sample index, samples. */\n")?;
    writeln!(f, "#define RESONARM_SAMPLE_WINDOW_MIN {}u\n/**@}}*/", timing::SAMPLE_WINDOW_MIN)
}

fn message(f: &mut fmt::Formatter<'_>, network: Network, kind: MessageKind) -> fmt::Result {
    let name = Macro(kind.name());
    let length = kind.form(network.profile()).map_or(0, |form| form.length);
    writeln!(f, "#define {name}_ID {:#05X}u", kind.id(network))?;
    // 0 is no data id of any network, as their high byte is at least 52h, so it can stand for an unprotected message.
    writeln!(f, "#define {name}_DATA_ID {:#06X}u", kind.data_id(network).unwrap_or(0))?;
    writeln!(f, "#define {name}_BYTES {length}u")
}

/// The name of a message in C: `RESONARM_FORCE_COMMAND` for `ForceCommand`.
struct Macro(&'static str);

impl fmt::Display for Macro {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RESONARM")?;
        for letter in self.0.chars() {
            // Each capital begins a word, so the first one writes the underscore after RESONARM.
            if letter.is_ascii_uppercase() {
                f.write_str("_")?;
            }
            write!(f, "{}", letter.to_ascii_uppercase())?;
        }
        Ok(())
    }
}
