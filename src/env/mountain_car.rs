//! MountainCarContinuous-v0.

/// The car.
#[derive(Debug)]
pub struct MountainCar;
