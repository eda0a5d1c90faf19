//! One MuJoCo simulation: the model, its state, and the calls that Gym makes.

use std::sync::Once;

use mujoco_rs::prelude::*;

use crate::env::{EnvError, EnvId, Pose, check_finite, check_length};

/// What the next step depends on, the solver's warm start included.
const STATE: u32 = MjtState::mjSTATE_INTEGRATION as u32;
/// The engine that the bindings are made for; they panic on any other.
const ENGINE_VERSION: &str = "3.17.0";
/// MuJoCo's own bound (`mjMAXVAL`): beyond it a number counts as diverged.
const MAX_MAGNITUDE: f64 = 1e10;

/// A model and its state.
pub(super) struct Simulation {
    env: EnvId,
    data: MjData<Box<MjModel>>,
}

impl Simulation {
    /// The simulation of `model` (MJCF).
    ///
    /// Errors: the library is of another version, or refuses the model.
    pub(super) fn new(env: EnvId, model: &str) -> Result<Self, EnvError> {
        send_messages_to_the_log();
        let refused = |message: String| EnvError::Engine { env, message };
        let version = mujoco_rs::mujoco_version();
        if version != ENGINE_VERSION {
            return Err(refused(format!("the library's version is {version}; {ENGINE_VERSION} is needed")));
        }
        let model = MjModel::from_xml_string(model).map_err(|error| refused(error.to_string()))?;
        let data = MjData::try_new(Box::new(model)).map_err(|error| refused(error.to_string()))?;
        Ok(Self { env, data })
    }

    /// Seconds that one call of `mj_step` takes.
    pub(super) fn time_step(&self) -> f64 {
        self.data.model_opt().timestep
    }

    /// Lower and upper bound of each control.
    pub(super) fn control_range(&self) -> &[[f64; 2]] {
        self.data.model().actuator_ctrlrange()
    }

    /// Generalised positions.
    pub(super) fn qpos(&self) -> &[f64] {
        self.data.qpos()
    }

    /// Generalised velocities.
    pub(super) fn qvel(&self) -> &[f64] {
        self.data.qvel()
    }

    /// Forces of the constraints on the joints.
    pub(super) fn constraint_forces(&self) -> &[f64] {
        self.data.qfrc_constraint()
    }

    /// Torque and force of the contacts on each body; [`update_contact_forces`](Self::update_contact_forces) computes them.
    pub(super) fn contact_forces(&self) -> &[f64] {
        self.data.cfrc_ext().as_flattened()
    }

    /// Where the origin of body `index` was at the last evaluation of the dynamics (up to one `mj_step` behind `qpos`).
    pub(super) fn body_position(&self, index: usize) -> [f64; 3] {
        self.data.xpos()[index]
    }

    /// Where site `index` was at the last evaluation of the dynamics (up to one `mj_step` behind `qpos`).
    pub(super) fn site_position(&self, index: usize) -> [f64; 3] {
        self.data.site_xpos()[index]
    }

    /// Puts everything back to the model's start, lets `disturb` change positions and velocities, and evaluates the
    /// dynamics there.
    pub(super) fn start(&mut self, disturb: impl FnOnce(&mut Self)) {
        self.data.reset();
        disturb(self);
        self.data.forward();
    }

    /// Generalised positions, to be changed inside [`start`](Self::start).
    pub(super) fn qpos_mut(&mut self) -> &mut [f64] {
        self.data.qpos_mut()
    }

    /// Generalised velocities, to be changed inside [`start`](Self::start).
    pub(super) fn qvel_mut(&mut self) -> &mut [f64] {
        self.data.qvel_mut()
    }

    /// Steps `times` under `action`, which MuJoCo clamps to the controls' range.
    ///
    /// Errors: the action has a wrong length or is not finite; the state diverged, upon which MuJoCo has put it back
    /// to the model's start.
    pub(super) fn advance(&mut self, action: &[f64], times: usize) -> Result<(), EnvError> {
        let controls = self.data.ctrl_mut();
        check_length(self.env, "the action", action.len(), controls.len())?;
        check_finite(self.env, "the action", action)?;
        controls.copy_from_slice(action);
        for _ in 0..times {
            self.data.step();
        }
        let warned = [MjtWarning::mjWARN_BADQPOS, MjtWarning::mjWARN_BADQVEL, MjtWarning::mjWARN_BADQACC]
            .iter()
            .any(|&warning| self.data.warning()[warning as usize].number > 0);
        // MuJoCo looks at a state when it leaves it, so the last one is still to be looked at.
        let outside = |x: &f64| x.is_nan() || x.abs() > MAX_MAGNITUDE;
        if warned || self.qpos().iter().chain(self.qvel()).any(outside) {
            return Err(EnvError::Diverged { env: self.env, action: action.to_vec() });
        }
        Ok(())
    }

    /// Computes [`contact_forces`](Self::contact_forces) from the last evaluation of the dynamics.
    pub(super) fn update_contact_forces(&mut self) {
        self.data.rne_post_constraint();
    }

    /// Positions and velocities.
    pub(super) fn pose(&self) -> Pose {
        Pose { qpos: self.qpos().to_vec(), qvel: self.qvel().to_vec() }
    }

    /// Length of a saved state.
    pub(super) fn state_len(&self) -> usize {
        self.data.model().state_size(STATE)
    }

    /// Everything that the next step depends on.
    pub(super) fn state(&self) -> Box<[f64]> {
        self.data.state(STATE)
    }

    /// Puts back what [`state`](Self::state) gave.
    pub(super) fn set_state(&mut self, state: &[f64]) -> Result<(), EnvError> {
        // Counters of warnings belong to no state, and an earlier divergence must not be taken for one of this state.
        self.data.reset();
        self.data
            .set_state(state, STATE)
            .map_err(|error| EnvError::Engine { env: self.env, message: error.to_string() })
    }
}

/// Sends what MuJoCo says to `tracing`: by itself it prints, and writes MUJOCO_LOG.TXT into the working directory.
fn send_messages_to_the_log() {
    static SENT: Once = Once::new();
    fn log(message: &MjLogMessage) {
        match message.level() {
            MjtLogLevel::mjLOG_ERROR => tracing::error!(target: "mujoco", "{}", message.subject()),
            // Deprecated attributes of the models, and divergence, which `advance` returns as an error.
            _ => tracing::debug!(target: "mujoco", "{}", message.subject()),
        }
    }
    #[expect(unsafe_code, reason = "MuJoCo's handler is a global, and the wrapper leaves the guarding of it to us")]
    SENT.call_once(|| {
        // SAFETY: no other thread may use MuJoCo meanwhile; this crate enters MuJoCo by `Simulation::new` alone, which
        // waits here until the handler is set.
        unsafe { mujoco_rs::logging::set_log_handler(log) }
    });
}

/// The engine's version, such as `3.17.0`.
pub fn engine_version() -> &'static str {
    mujoco_rs::mujoco_version()
}
