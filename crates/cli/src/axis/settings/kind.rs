//! What a profile is for, and what a controller is.

use std::fmt;
use stepdrive_host::settings::Family;
use stepdrive_spec::smsd::models::Model;

/// A kind of controller. It displays as people call it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ControllerKind {
    /// An SMSD; its model, unless that is one that the maker does not list.
    Smsd(Option<Model>),
    /// An SMD3.
    Smd3,
}

impl ControllerKind {
    /// All that a profile may be for.
    pub(super) const ALL: [ControllerKind; 4] = [
        ControllerKind::Smsd(Some(Model::Smsd42)),
        ControllerKind::Smsd(Some(Model::Smsd80)),
        ControllerKind::Smsd(None),
        ControllerKind::Smd3,
    ];

    /// What `model` says of it in a profile.
    pub(super) fn name(self) -> &'static str {
        match self {
            ControllerKind::Smsd(Some(model)) => model.name(),
            ControllerKind::Smsd(None) => "SMSD",
            ControllerKind::Smd3 => "SMD3",
        }
    }

    /// The kind of this name.
    pub(super) fn from_name(name: &str) -> Option<ControllerKind> {
        ControllerKind::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Its family.
    pub(super) fn family(self) -> Family {
        match self {
            ControllerKind::Smsd(_) => Family::Smsd,
            ControllerKind::Smd3 => Family::Smd3,
        }
    }

    /// Its model, where that is known.
    pub(super) fn model(self) -> Option<Model> {
        match self {
            ControllerKind::Smsd(model) => model,
            ControllerKind::Smd3 => None,
        }
    }
}

impl fmt::Display for ControllerKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ControllerKind::Smsd(None) => f.write_str("SMSD of unknown model"),
            ControllerKind::Smsd(Some(_)) | ControllerKind::Smd3 => f.write_str(self.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_a_name_of_its_own_and_every_model_is_one() {
        for kind in ControllerKind::ALL {
            assert_eq!(ControllerKind::from_name(kind.name()), Some(kind));
        }
        for model in Model::ALL {
            assert_eq!(ControllerKind::from_name(model.name()), Some(ControllerKind::Smsd(Some(model))));
        }
        assert_eq!(ControllerKind::from_name("smsd"), None);
    }
}
