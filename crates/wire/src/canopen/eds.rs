//! The electronic data sheet of a node (CiA 306-1), generated from its object dictionary.

use core::fmt;

use super::NODE_ID_MAX;
use super::dictionary::{Access, Dictionary, Entry, Kind, Mappable, Value};

/// An EDS, which [`fmt::Display`] writes. Values that depend on the node id are written as `$NODEID+0x…`, so
/// that one file fits all nodes of the kind.
#[derive(Clone, Copy, Debug)]
pub struct Eds<'a> {
    /// Object dictionary of the node.
    pub dictionary: &'a Dictionary,
    /// Node id that the dictionary's values contain.
    pub node_id: u8,
    /// Name of the EDS file.
    pub file: &'a str,
    /// Name of the product.
    pub product: &'a str,
    /// Version of the program that generates the file.
    pub version: &'a str,
}

impl fmt::Display for Eds<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Eds { dictionary, file, product, version, .. } = self;
        writeln!(f, "[FileInfo]\nFileName={file}\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0")?;
        writeln!(f, "Description=Object dictionary of a simulated drive\nCreatedBy=resonarm {version}\n")?;
        writeln!(f, "[DeviceInfo]\nVendorName=Resonarm\nVendorNumber={}", number(dictionary, 1))?;
        writeln!(f, "ProductName={product}\nProductNumber={}", number(dictionary, 2))?;
        writeln!(f, "RevisionNumber={}\nOrderCode=none", number(dictionary, 3))?;
        for rate in [10, 20, 50, 125, 250, 500, 800, 1000] {
            writeln!(f, "BaudRate_{rate}=1")?;
        }
        writeln!(f, "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0")?;
        writeln!(f, "CompactPDO=0\nGroupMessaging=0\nNrOfRXPDO=4\nNrOfTXPDO=4\nLSS_Supported=0\n")?;
        writeln!(f, "[DummyUsage]")?;
        for index in 1..=7 {
            writeln!(f, "Dummy{index:04}=0")?;
        }
        writeln!(f, "\n[Comments]\nLines=0\n")?;
        // CiA 306 requires three lists. Every object that is not mandatory is optional here, since there are no
        // manufacturer-specific ones.
        const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];
        self.list(f, "MandatoryObjects", |index| MANDATORY.contains(&index))?;
        self.list(f, "OptionalObjects", |index| !MANDATORY.contains(&index))?;
        self.list(f, "ManufacturerObjects", |_| false)?;
        self.objects(f)
    }
}

/// Returns an entry of the identity object, 1018.
fn number(dictionary: &Dictionary, subindex: u8) -> i64 {
    dictionary.number(super::dictionary::at(0x1018, subindex))
}

impl Eds<'_> {
    fn list(&self, f: &mut fmt::Formatter<'_>, name: &str, holds: impl Fn(u16) -> bool) -> fmt::Result {
        let indices = || self.dictionary.objects().iter().map(|object| object.index).filter(|index| holds(*index));
        writeln!(f, "[{name}]\nSupportedObjects={}", indices().count())?;
        for (place, index) in indices().enumerate() {
            writeln!(f, "{}=0x{index:04X}", place + 1)?;
        }
        writeln!(f)
    }

    fn objects(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for object in self.dictionary.objects() {
            if let (Kind::Variable, [entry]) = (object.kind, object.entries.as_slice()) {
                writeln!(f, "[{:04X}]", object.index)?;
                self.entry(f, entry)?;
                continue;
            }
            let count = object.entries.len();
            writeln!(f, "[{:04X}]\nParameterName={}", object.index, object.name)?;
            writeln!(f, "ObjectType=0x{:X}\nSubNumber={count}\n", object.kind.number())?;
            for entry in &object.entries {
                writeln!(f, "[{:04X}sub{:X}]", object.index, entry.subindex)?;
                self.entry(f, entry)?;
            }
        }
        Ok(())
    }

    fn entry(&self, f: &mut fmt::Formatter<'_>, entry: &Entry) -> fmt::Result {
        let access = match entry.access {
            Access::Const => "const",
            Access::ReadOnly => "ro",
            Access::ReadWrite => "rw",
            Access::WriteOnly => "wo",
        };
        writeln!(f, "ParameterName={}\nObjectType=0x7", entry.name)?;
        writeln!(f, "DataType=0x{:04X}\nAccessType={access}", entry.initial.type_number())?;
        write!(f, "DefaultValue=")?;
        match entry.initial {
            Value::Text(text) => text.bytes().iter().try_for_each(|byte| write!(f, "{}", char::from(*byte)))?,
            value if entry.is_by_node => {
                // The dictionary holds the sum. Taking the node id off again gives the constant, which is the
                // same for all nodes.
                let base = value.number().unwrap_or(0) - i64::from(self.node_id.min(NODE_ID_MAX));
                write!(f, "$NODEID+0x{base:X}")?;
            }
            value => write!(f, "{}", value.number().unwrap_or(0))?,
        }
        if let Some((least, most)) = entry.limits {
            write!(f, "\nLowLimit={least}\nHighLimit={most}")?;
        }
        writeln!(f, "\nPDOMapping={}\n", u8::from(entry.mappable != Mappable::No))
    }
}
