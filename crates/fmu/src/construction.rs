//! The model of a content, and its variables.

use crate::bus::BusModel;
use crate::content::{Content, Interface, Role, Settings};
use crate::fault::Fault;
use crate::model::{Model, Parameters};
use crate::node::Node;
use crate::signals::Signals;
use crate::variables::{self, Variable};

/// The variables of a content.
pub(crate) fn variables(content: &Content) -> Result<Vec<Variable>, Fault> {
    match content.settings.role {
        Role::Plant => {
            let session = Parameters::of(&content.scenario).session(content)?;
            Ok(variables::table(content, Some(&session.plant_at_start())))
        }
        Role::Exciter | Role::Bus => Ok(variables::table(content, None)),
    }
}

/// The model of a content, at its start.
pub(crate) fn build(content: &Content, parameters: &Parameters) -> Result<Box<dyn Model>, Fault> {
    let Settings { interface, role, clock, nodes } = content.settings;
    Ok(match (interface, role) {
        (Interface::Signals, _) => Box::new(Signals::new(parameters.session(content)?)),
        (Interface::Can, Role::Plant | Role::Exciter) => {
            Box::new(Node::new(parameters.session(content)?, role == Role::Plant, clock)?)
        }
        (Interface::Can, Role::Bus) => {
            let spec = content.scenario.timed_bus()?.ok_or(Fault::NoBitRate)?;
            Box::new(BusModel::new(&spec, nodes, clock))
        }
    })
}
