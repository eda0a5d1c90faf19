//! The six MuJoCo tasks; the only place that names `mujoco_rs`.
