//! Where the exciter and the accelerometers of a rig are on a structure.

use super::StructureSectionError;
use resonarm_bench::plant::{Placed, Places};
use resonarm_bench::rig::{PlaceName, RigSpec};
use resonarm_dynamics::structure::Assembly;

/// The point at the end of a chain, where exciter and accelerometer C are unless the scenario says otherwise.
const TIP: &str = "tip";

/// Where the rig is: by `at` of the exciter and the accelerometers, each a point, or a degree of freedom for their x
/// axis alone. Without it the exciter is at `tip`, the accelerometer C where the exciter is, and B at joint 2, or,
/// where there is none that moves, where the exciter is.
pub(super) fn places(assembly: &Assembly, rig: &RigSpec) -> Result<Places, StructureSectionError> {
    let default = |wanted: &str| assembly.points().iter().any(|point| point == wanted);
    let exciter = match &rig.exciter.at {
        Some(at) => at.as_str(),
        None if default(TIP) => TIP,
        None => {
            let points = assembly.points();
            let reason = format!("is missing: name the point that it acts on; there are {}", points.join(", "));
            return Err(StructureSectionError::Rig { instrument: "exciter", reason });
        }
    };
    let b = rig.sensors.b.at.as_ref().map(PlaceName::as_str);
    let b = b.unwrap_or(if default("joint2") { "joint2" } else { exciter });
    let c = rig.sensors.c.at.as_ref().map_or(exciter, PlaceName::as_str);
    Ok(Places {
        exciter: placed(assembly, "exciter", exciter)?,
        accelerometer_b: placed(assembly, "sensors.b", b)?,
        accelerometer_c: placed(assembly, "sensors.c", c)?,
    })
}

/// The degrees of freedom along x and y of a point, those that the structure has; or one for x.
fn placed(assembly: &Assembly, instrument: &'static str, at: &str) -> Result<Placed, StructureSectionError> {
    let points = assembly.points();
    if at.contains('.') {
        let unknown = |error| StructureSectionError::Rig { instrument, reason: format!("is `{at}`: {error}") };
        let dof = assembly.dof(at).map_err(unknown)?;
        if dof.is_base() {
            let reason = format!(
                "is `{at}`, whose load is an acceleration, and a rig commands forces: frf, continue, simulate, sweep and basins move the \
                 base; for a run take the free structure, with the table's mass and modes at 0 Hz, and its exciter at the table"
            );
            return Err(StructureSectionError::Rig { instrument, reason });
        }
        return Ok(Placed { along: [Some(dof), None] });
    }
    let found = Placed::at_point(assembly, at);
    let is_known = points.iter().any(|point| point == at);
    if is_known && found.along.iter().any(Option::is_some) {
        return Ok(found);
    }
    let reason = match is_known {
        true => format!("is `{at}`, which moves along z alone: write \"{at}.z\""),
        false => format!("is `{at}`: the points are {}", points.join(", ")),
    };
    Err(StructureSectionError::Rig { instrument, reason })
}
