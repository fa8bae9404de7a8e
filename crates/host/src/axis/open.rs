//! An axis from where its controller is.

use super::limits::SoftLimits;
use super::smd3::Smd3Motor;
use super::smsd::SmsdMotor;
use super::{Axis, DriveAxis};
use crate::smd3::Smd3Client;
use crate::smsd::SmsdOptions;
use crate::trust::TrustState;
use crate::units::Scale;
use crate::uri::Target;
use crate::wire::Timeouts;

/// What there is to know of an axis beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisOptions {
    /// How it is measured.
    pub scale: Scale,
    /// Where it may go.
    pub limits: SoftLimits,
    /// What was known of its position when a program last ended.
    pub trust: TrustState,
    /// The password of an SMSD; the factory's otherwise.
    pub password: Option<u64>,
    /// To connect, and for each reply.
    pub timeouts: Timeouts,
}

impl Default for AxisOptions {
    /// Full steps, no limits, nothing known.
    fn default() -> AxisOptions {
        AxisOptions {
            scale: Scale::STEPS,
            limits: SoftLimits::OFF,
            trust: TrustState::new(),
            password: None,
            timeouts: Timeouts::default(),
        }
    }
}

/// The axis of a target. Nothing is opened yet.
pub fn open(target: &Target, options: &AxisOptions) -> Box<dyn Axis> {
    match target.smsd(target.connect(), smsd_options(target, options)) {
        Some(driver) => boxed(SmsdMotor::new(&target.name(), driver), options),
        None => boxed(Smd3Motor::new(Smd3Client::new(target.connect(), options.timeouts)), options),
    }
}

fn boxed<M: super::Motor + 'static>(motor: M, options: &AxisOptions) -> Box<dyn Axis> {
    let axis = DriveAxis::new(motor).with_scale(options.scale).with_limits(options.limits);
    Box::new(axis.with_trust(options.trust))
}

fn smsd_options(target: &Target, options: &AxisOptions) -> SmsdOptions {
    let factory = target.smsd_options().unwrap_or_default();
    SmsdOptions {
        password: options.password.unwrap_or(factory.password),
        timeouts: options.timeouts,
        ..factory
    }
}
