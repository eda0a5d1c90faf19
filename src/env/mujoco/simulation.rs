//! One MuJoCo simulation: the model, its state, and the calls that Gym makes.

use std::{fmt, path::Path, sync::Once};

use mujoco_rs::{prelude::*, wrappers::mj_auxiliary::MjVfs};

use super::model::Model;
use crate::env::{EnvError, Flaw, Pose, check_finite, check_length};

/// The parts of the state that the next step depends on, the solver's warm start included.
const STATE: u32 = MjtState::mjSTATE_INTEGRATION as u32;
/// The engine's version that the bindings are made for; they panic on any other.
const ENGINE_VERSION: &str = "3.17.0";
/// MuJoCo's own bound (`mjMAXVAL`): beyond it a number counts as diverged.
const MAX_MAGNITUDE: f64 = 1e10;

/// A model and its state.
pub(super) struct Simulation {
    /// The environment's name, for messages.
    env: &'static str,
    data: MjData<Box<MjModel>>,
}

impl Simulation {
    /// The simulation of `model`, for the environment called `env`.
    ///
    /// # Errors
    ///
    /// The library is of another version, or refuses the model; a file that the model needs has
    /// changed.
    pub(super) fn new(env: &'static str, model: &Model) -> Result<Self, EnvError> {
        send_messages_to_the_log();
        let refused = |message: String| EnvError::Engine {
            env: env.to_owned(),
            message,
        };
        let version = mujoco_rs::mujoco_version();
        if version != ENGINE_VERSION {
            return Err(refused(format!(
                "the library's version is {version}; {ENGINE_VERSION} is needed"
            )));
        }
        let flawed = |flaw| EnvError::Robot {
            env: env.to_owned(),
            key: "model",
            index: None,
            flaw: Box::new(flaw),
        };
        model.check_files().map_err(flawed)?;
        let loaded = match &model.path {
            None => MjModel::from_xml_string(&model.text).map_err(said),
            Some(path) => from_text_at(&model.text, path),
        };
        let data = MjData::try_new(Box::new(loaded.map_err(refused)?))
            .map_err(|error| refused(said(error)))?;
        let simulation = Self { env, data };
        let seconds = simulation.time_step();
        if !(seconds.is_finite() && seconds > 0.0) {
            return Err(flawed(Flaw::TimeStep { seconds }));
        }
        Ok(simulation)
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

    /// Whether each control is held to its range.
    pub(super) fn control_limited(&self) -> impl Iterator<Item = bool> {
        self.data.model().actuator_ctrllimited().iter().copied()
    }

    /// Number of the body, counted from the world's 0, or of the site that the model calls `name`.
    pub(super) fn find(&self, kind: Named, name: &str) -> Option<usize> {
        let kind = match kind {
            Named::Body => MjtObjBase::mjOBJ_BODY,
            Named::Site => MjtObjBase::mjOBJ_SITE,
        };
        self.data.model().name_to_id(kind, name)
    }

    /// The names of the model's bodies or sites.
    pub(super) fn names(&self, kind: Named) -> Vec<&str> {
        let model = self.data.model();
        let (kind, count) = match kind {
            Named::Body => (MjtObjBase::mjOBJ_BODY, self.data.xpos().len()),
            Named::Site => (MjtObjBase::mjOBJ_SITE, self.data.site_xpos().len()),
        };
        (0..count)
            .filter_map(|id| model.id_to_name(kind, id))
            .collect()
    }

    /// Forces of the constraints on the joints.
    pub(super) fn constraint_forces(&self) -> &[f64] {
        self.data.qfrc_constraint()
    }

    /// Forces of the actuators on the joints.
    pub(super) fn actuator_forces(&self) -> &[f64] {
        self.data.qfrc_actuator()
    }

    /// Inertia and mass of each body about the centre of mass.
    pub(super) fn inertias(&self) -> &[f64] {
        self.data.cinert().as_flattened()
    }

    /// Velocity of each body, turning and moving.
    pub(super) fn body_velocities(&self) -> &[f64] {
        self.data.cvel().as_flattened()
    }

    /// A coordinate of the whole model's centre of mass at the last evaluation of the dynamics.
    pub(super) fn center_of_mass(&self, axis: usize) -> f64 {
        let masses = self.data.model().body_mass();
        let moment: f64 = masses
            .iter()
            .zip(self.data.xipos())
            .map(|(mass, position)| mass * position[axis])
            .sum();
        moment / masses.iter().sum::<f64>()
    }

    /// Torque and force of the contacts on each body;
    /// [`update_contact_forces`](Self::update_contact_forces) computes them.
    pub(super) fn contact_forces(&self) -> &[f64] {
        self.data.cfrc_ext().as_flattened()
    }

    /// Where the origin of body `index` was at the last evaluation of the dynamics (up to one
    /// `mj_step` behind `qpos`).
    pub(super) fn body_position(&self, index: usize) -> [f64; 3] {
        self.data.xpos()[index]
    }

    /// Where site `index` was at the last evaluation of the dynamics (up to one `mj_step` behind
    /// `qpos`).
    pub(super) fn site_position(&self, index: usize) -> [f64; 3] {
        self.data.site_xpos()[index]
    }

    /// Puts everything back to the model's start, lets `disturb` change positions and velocities,
    /// and evaluates the dynamics there.
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
    /// # Errors
    ///
    /// The action has a wrong length or is not finite; or the state diverged, and MuJoCo has reset
    /// it to the model's start.
    pub(super) fn advance(&mut self, action: &[f64], times: usize) -> Result<(), EnvError> {
        let controls = self.data.ctrl_mut();
        check_length(self.env, "the action", action.len(), controls.len())?;
        check_finite(self.env, "the action", action)?;
        controls.copy_from_slice(action);
        for _ in 0..times {
            self.data.step();
        }
        let warned = [
            MjtWarning::mjWARN_BADQPOS,
            MjtWarning::mjWARN_BADQVEL,
            MjtWarning::mjWARN_BADQACC,
        ]
        .iter()
        .any(|&warning| self.data.warning()[warning as usize].number > 0);
        // MuJoCo checks a state when it steps on from it, so the last state is not checked yet.
        let outside = |x: &f64| x.is_nan() || x.abs() > MAX_MAGNITUDE;
        if warned || self.qpos().iter().chain(self.qvel()).any(outside) {
            return Err(EnvError::Diverged {
                env: self.env.to_owned(),
                action: action.to_vec(),
            });
        }
        Ok(())
    }

    /// Computes [`contact_forces`](Self::contact_forces) from the last evaluation of the dynamics.
    pub(super) fn update_contact_forces(&mut self) {
        self.data.rne_post_constraint();
    }

    /// Positions and velocities.
    pub(super) fn pose(&self) -> Pose {
        Pose {
            qpos: self.qpos().to_vec(),
            qvel: self.qvel().to_vec(),
        }
    }

    /// Length of a saved state.
    pub(super) fn state_len(&self) -> usize {
        self.data.model().state_size(STATE)
    }

    /// Everything that the next step depends on.
    pub(super) fn state(&self) -> Box<[f64]> {
        self.data.state(STATE)
    }

    /// Restores a state of [`state`](Self::state).
    pub(super) fn set_state(&mut self, state: &[f64]) -> Result<(), EnvError> {
        // Warning counters belong to no state: an earlier divergence must not count against this
        // one.
        self.data.reset();
        self.data
            .set_state(state, STATE)
            .map_err(|error| EnvError::Engine {
                env: self.env.to_owned(),
                message: said(error),
            })
    }
}

/// A kind of thing that a model names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Named {
    /// A body.
    Body,
    /// A site.
    Site,
}

/// The model `text` as if it stood at `path`; MuJoCo looks beside that for the files that it names.
///
/// # Errors
///
/// MuJoCo refuses it, in these words.
fn from_text_at(text: &str, path: &Path) -> Result<MjModel, String> {
    let mut files = MjVfs::new();
    files.add_from_buffer(path, text.as_bytes()).map_err(said)?;
    MjModel::from_xml_vfs(path, &files).map_err(said)
}

/// The engine's message.
fn said(error: impl fmt::Display) -> String {
    error.to_string()
}

/// Sends MuJoCo's messages to `tracing`; without this it prints, and writes MUJOCO_LOG.TXT into the
/// working directory.
fn send_messages_to_the_log() {
    static SENT: Once = Once::new();
    fn log(message: &MjLogMessage) {
        match message.level() {
            MjtLogLevel::mjLOG_ERROR => tracing::error!(target: "mujoco", "{}", message.subject()),
            // These are about deprecated attributes of the models, and about divergence, which
            // `advance` returns as an error.
            _ => tracing::debug!(target: "mujoco", "{}", message.subject()),
        }
    }
    #[expect(
        unsafe_code,
        reason = "MuJoCo's handler is a global, and the wrapper leaves the guarding of it to us"
    )]
    SENT.call_once(|| {
        // SAFETY: no other thread may use MuJoCo meanwhile; this crate enters MuJoCo by
        // `Simulation::new` alone, which waits here until the handler is set.
        unsafe { mujoco_rs::logging::set_log_handler(log) }
    });
}

/// The engine's version, such as `3.17.0`.
pub fn engine_version() -> &'static str {
    mujoco_rs::mujoco_version()
}
