use alloc::vec;

use resonarm_dynamics::structure::{Assembly, BodySpec, ChainSpec, Preset, StructureSpec};

/// A chain without elements.
pub(crate) fn assembly_of(chain: ChainSpec) -> Assembly {
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
}

/// A preset with its links at angles, degrees.
pub(crate) fn preset_at(preset: Preset, angles_deg: [f64; 2]) -> Assembly {
    assembly_of(preset.chain().unwrap().at_angles_deg(&angles_deg))
}
