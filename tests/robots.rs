//! Robots of one's own, and environments that this crate does not know.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use mcpo_run::{
    algo::{Agent, OnPolicy, trpo},
    env::{EnvError, EnvId, Environment, EpisodeEnd, Outcome, Pose, Reward, Spaces, Task},
    nn::{GaussianPolicy, Mlp, Normalizer},
    plan::{self, RunSpec, Versions},
    quantity::constant,
    rng::{Rng, Seed, Stream},
    spec::{self, Overrides, SpecErrors},
    train::rollout::Rollout,
};
use rand::RngExt;

/// The runs of a matrix of `env` alone, whose file, at `folder`, has `tables` too.
fn planned(folder: &Path, env: &str, tables: &str) -> Result<Vec<RunSpec>, SpecErrors> {
    let text = format!(
        "name = 'own'\nbudget.env_steps = 4096\n[[matrix]]\nseed = [0]\nenv = ['{env}']\nalgorithm = ['ppo']\n\
         reward = ['dense']\n{tables}"
    );
    let spec = spec::parse(&folder.join("own.toml"), &text, &Overrides::default())?;
    Ok(plan::plan(&spec).expect("what was read can be planned"))
}

/// The environment called `Mine` that `table` describes, as a worker reads it.
fn mine(folder: &Path, table: &str) -> EnvId {
    let run = planned(folder, "Mine", &format!("[environments.Mine]\n{table}"))
        .expect("a robot")
        .remove(0);
    let text = serde_json::to_string(&run).expect("a run can be written");
    let read: RunSpec = serde_json::from_str(&text).expect("and read");
    assert_eq!(read, run);
    read.env
}

/// The example that ships, in a folder of its own.
fn example() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for file in ["robot.toml", "robot.xml"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("examples/robot")
            .join(file);
        fs::copy(from, folder.path().join(file)).expect("it ships");
    }
    folder
}

/// The exit code of the program in `folder`, and all that it prints.
fn mcpo_run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_mcpo-run"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (
        output.status.code(),
        text + &String::from_utf8_lossy(&output.stderr),
    )
}

/// What 400 random steps show, as bits.
fn trace(env: EnvId) -> Vec<u64> {
    let mut task = Task::new(env, Reward::Dense, 300).expect("a task");
    let mut rng = Seed(5).stream(Stream::Environment, 0);
    let Spaces {
        observation_dim,
        action_dim,
        action_bound,
    } = task.spaces();
    let mut observation = vec![0.0; observation_dim];
    task.reset(&mut rng, &mut observation);
    let mut bits = Vec::new();
    for step in 0..400 {
        // Small ones beside great ones, so that episodes are long and short.
        let bound = if step / 100 % 2 == 0 { 0.3 } else { 1.5 } * action_bound;
        let action: Vec<f64> = (0..action_dim)
            .map(|_| rng.random_range(-bound..bound))
            .collect();
        let transition = task.step(&action, &mut observation).expect("a step");
        bits.extend(
            observation
                .iter()
                .chain([&transition.reward])
                .map(|x| x.to_bits()),
        );
        bits.push(
            transition
                .end
                .map_or(0, |end| 1 + u64::from(end == EpisodeEnd::Truncated)),
        );
        if transition.end.is_some() {
            task.reset(&mut rng, &mut observation);
        }
    }
    bits
}

/// That those that ship take the steps which they took before they were tables is for the record in
/// `results/ci` to say, and Gymnasium's transitions say that these are the right ones.
#[test]
fn a_robot_that_is_written_as_one_that_ships_takes_the_same_steps() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"));
    for env in EnvId::shipped().filter(|env| *env != EnvId::MountainCar) {
        let table = match env.name() {
            "HalfCheetah-v2" => "half_cheetah".to_owned(),
            "InvertedPendulum-v2" => "inverted_pendulum".to_owned(),
            "InvertedDoublePendulum-v2" => "inverted_double_pendulum".to_owned(),
            _ => env.family().to_lowercase(),
        };
        let text = fs::read_to_string(source.join(format!("src/env/robots/{table}.toml")))
            .expect("it ships");
        let own = mine(&source.join("third_party/models"), &text);
        assert!(own != env && own.is_own(), "{env}");
        assert_eq!(own.spaces(), env.spaces(), "{env}");
        assert_eq!(own.model_digest(), env.model_digest(), "{env}");
        assert!(trace(own) == trace(env), "{env}");
        let kind = |env: EnvId| std::mem::discriminant(&env.sparse_reward());
        assert_eq!(kind(own), kind(env), "{env}");
    }
}

#[test]
fn mistakes_are_told_where_they_are() {
    let folder = example();
    let text = fs::read_to_string(folder.path().join("robot.toml")).expect("it was copied");
    let model = fs::read_to_string(folder.path().join("robot.xml")).expect("it was copied");
    let told = |from: &str, to: &str| {
        assert!(text.contains(from) || model.contains(from), "{from}");
        fs::write(folder.path().join("robot.xml"), model.replace(from, to)).expect("written");
        let path = folder.path().join("robot.toml");
        let changed = if model.contains(from) {
            text.clone()
        } else {
            text.replace(from, to)
        };
        let errors = spec::parse(&path, &changed, &Overrides::default()).expect_err(to);
        errors
            .iter()
            .map(|error| format!("{:?} {error} {:?}", error.line(), error.label))
            .collect::<Vec<_>>()
            .join("\n")
    };
    for (from, to, expected) in [
        (
            "frame_skip ",
            "frame_skpi ",
            vec![
                "Some(6) unknown key `frame_skpi`",
                "the nearest known key is `frame_skip`",
            ],
        ),
        (
            "frame_skip ",
            "frame_skpi ",
            vec!["Some(4) the robot `Sled` has no `frame_skip`"],
        ),
        (
            "position = 1 }, above",
            "position = 7 }, above",
            vec!["Some(9) `alive`: the model has 2 positions, 0 to 1"],
        ),
        (
            "above = -0.5, below = 0.5",
            "above = 0.5, below = -0.5",
            vec!["Some(9) `alive`: no number is beyond 0.5"],
        ),
        (
            "clip = 10",
            "clip = -1",
            vec!["Some(7) `observation`: -1 is out of range"],
        ),
        (
            "from = 1 } }",
            "from = 2 } }",
            vec!["Some(7) `observation`: there are 2 numbers"],
        ),
        (
            "forward_velocity",
            "forward_speed",
            vec!["Some(8) `dense_reward`: unknown name `forward_speed`"],
        ),
        (
            "control_cost = 0.01",
            "goal_distance = { weight = 1 }",
            vec!["Some(8) `dense_reward`: it needs a `goal`"],
        ),
        (
            "{ position = 1 }",
            "{ body = { name = 'mats', axis = 'x' } }",
            vec!["no body `mats`", "`sled`, `mast`"],
        ),
        (
            "positions = { from = 1 } }, { velocities = { clip = 10 } }",
            "positions = { clip = -1 } }, { velocities = { clip = -2 } }",
            vec![
                "Some(7) `observation`: -1 is out of range",
                "Some(7) `observation`: -2 is out of range",
            ],
        ),
        (
            "environments.Sled",
            "environments.\"my sled\"",
            vec!["Some(4) `my sled` cannot name an environment"],
        ),
        (
            "[\"Sled\"]",
            "[\"Zeppelin\"]",
            vec!["unknown environment `Zeppelin`", ", `Sled`"],
        ),
        (
            "[\"Sled\"]",
            "[\"Sledd\"]",
            vec![
                "unknown environment `Sledd`",
                "the nearest known one is `Sled`",
            ],
        ),
        (
            "\"distance\"",
            "{ goal = 0.1 }",
            vec!["Some(11) `landmark`: it needs a `goal`"],
        ),
        (
            "landmark      = \"distance\"",
            "",
            vec!["`sparse2` is not a reward", "names no `landmark`"],
        ),
        (
            "environments.Sled",
            "environments.Hopper-v2",
            vec!["Some(5) `model` cannot be set: Hopper-v2 ships"],
        ),
        (
            "\"robot.xml\"",
            "\"none.xml\"",
            vec!["Some(5) `model`: cannot read", "none.xml"],
        ),
        (
            "name=\"lean\"",
            "nme=\"lean\"",
            vec![
                "Some(9) MuJoCo refuses the model of `Sled`",
                "unrecognized attribute: 'nme'",
            ],
        ),
        (
            "ctrlrange=\"-1 1\"",
            "ctrlrange=\"0 1\"",
            vec!["`actions`: actuator 0", "write `actions = \"scaled\"`"],
        ),
        (
            "timestep=\"0.01\"",
            "timestep=\"0\"",
            vec!["Some(5) `model`: its `timestep` is 0"],
        ),
        (
            "timestep=\"0.01\"",
            "timestep=\"-0.01\"",
            vec!["Some(5) `model`: its `timestep` is -0.01"],
        ),
        (
            "ctrlrange=\"-1 1\"",
            "",
            vec!["`actions`: actuator 0, counted from 0, has no `ctrlrange`"],
        ),
        (
            "landmark      =",
            "goal = { body = \"mast\" }\nlandmark      =",
            vec!["Some(11) `Sled`: `target` is missing"],
        ),
        (
            "landmark      =",
            "goal = { body = \"mast\", target = 3 }\nlandmark      =",
            vec!["Some(11) `goal.target`: 3 does not belong here"],
        ),
        (
            "velocities = { uniform = 0.05 }",
            "disc = { first = 0, radius = -1 }",
            vec!["Some(10) `initial_noise.disc.radius`: -1"],
        ),
        (
            "velocities = { uniform = 0.05 }",
            "velocities = { uniform = 1e308 }",
            vec!["Some(10) `initial_noise`: 1e308 is too wide"],
        ),
        (
            "frame_skip    = 2",
            "frame_skip    = 2_000_000_000",
            vec!["Some(6) `frame_skip`: it is 2000000000; 10000 at most"],
        ),
    ] {
        let told = told(from, to);
        assert!(
            expected.iter().all(|part| told.contains(part)),
            "{to}: {told}"
        );
    }
}

/// The table of a robot whose model and mesh [`stone`] writes.
const STONE: &str = "model = 'stone.xml'\nframe_skip = 1\nactions = 'scaled'\n\
    observation = [{ positions = {} }, { velocities = {} }]\n\
    dense_reward = [{ forward_velocity = 1.0 }]\n";

/// Writes a model with a mesh of `height` beside it, whose path is returned.
fn stone(folder: &Path, height: f64) -> PathBuf {
    let meshes = folder.join("meshes");
    fs::create_dir_all(&meshes).expect("made");
    let mesh = meshes.join("stone.obj");
    let corners = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {height}\n");
    fs::write(&mesh, corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n").expect("written");
    let model = "<mujoco><compiler meshdir='meshes'/>\
        <asset><mesh name='stone' file='stone.obj'/></asset><worldbody>\
        <body><joint name='x' type='slide' axis='1 0 0'/><geom type='mesh' mesh='stone'/></body>\
        </worldbody><actuator><motor joint='x' ctrlrange='0 2'/></actuator></mujoco>";
    fs::write(folder.join("stone.xml"), model).expect("written");
    mesh
}

#[test]
fn a_run_whose_mesh_is_gone_is_refused_before_it_is_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = stone(folder.path(), 1.0);
    let matrix = "name = 'stone'\nreward = 'dense'\nbudget.env_steps = 64\n\
        network.hidden = [4]\nevaluation.final_episodes = 1\n\
        [rollout]\nsteps = 64\n[algorithms.ppo]\nminibatch = 64\n\
        [[matrix]]\nseed = [0]\nenv = ['Stone']\nalgorithm = ['ppo']\n[environments.Stone]\n";
    fs::write(folder.path().join("stone.toml"), matrix.to_owned() + STONE).expect("written");
    let (code, text) = mcpo_run(folder.path(), &["run", "stone.toml", "--quiet"]);
    assert_eq!(code, Some(0), "{text}");
    let run = ["reproduce", "results/stone/runs/Stone/ppo/seed-0"];
    let (code, text) = mcpo_run(folder.path(), &run);
    assert_eq!(code, Some(0), "{text}");

    fs::remove_file(mesh).expect("removed");
    let (code, text) = mcpo_run(folder.path(), &run);
    assert_eq!(code, Some(2), "{text}");
    assert!(
        text.contains("cannot be reproduced") && text.contains("stone.obj"),
        "{text}"
    );
}

#[test]
fn a_mesh_beside_the_model_is_found_and_known_again() {
    let folder = tempfile::tempdir().expect("a folder");
    stone(folder.path(), 1.0);
    let first = mine(folder.path(), STONE);
    assert_eq!(
        first
            .spaces()
            .map(|spaces| (spaces.observation_dim, spaces.action_bound)),
        Some((2, 1.0))
    );
    assert_eq!(mine(folder.path(), STONE), first, "the same robot");

    stone(folder.path(), 2.0);
    let error = Task::new(first, Reward::Dense, 9)
        .err()
        .expect("another mesh")
        .to_string();
    assert!(
        error.contains("stone.obj, which the model needs, is not what it was"),
        "{error}"
    );
    let second = mine(folder.path(), STONE);
    assert_ne!(second.model_digest(), first.model_digest());
    assert!(second != first && second.name() == first.name());
}

#[test]
fn a_scaled_action_reaches_the_whole_range_of_its_actuator() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>\
                 <geom size='0.1' mass='1'/></body></worldbody><actuator><motor joint='x' ctrlrange='1 3'/></actuator>\
                 </mujoco>";
    fs::write(folder.path().join("ball.xml"), model).expect("written");
    let table = "model = 'ball.xml'\nframe_skip = 1\nactions = 'scaled'\nobservation = [{ velocities = {} }]\n\
                 dense_reward = [{ alive = 1.0 }]\n";
    let env = mine(folder.path(), table);
    // A mass of 1 kg gains in 2 ms what the force gives it.
    for (action, force) in [(-1.0, 1.0), (0.0, 2.0), (1.0, 3.0), (5.0, 3.0)] {
        let mut task = Task::new(env, Reward::Dense, 9).expect("a task");
        let mut velocity = [0.0];
        task.reset(&mut Seed(0).stream(Stream::Environment, 0), &mut velocity);
        task.step(&[action], &mut velocity).expect("a step");
        assert!(
            (velocity[0] - 0.002 * force).abs() < 1e-12,
            "{action}: {velocity:?}"
        );
    }
}

/// The versions that a fingerprint of a run in `env` holds.
fn versions(env: EnvId) -> Versions {
    Versions {
        revisions: [].into(),
        env: env.revision(),
        mujoco: None,
        model: env.model_digest(),
    }
}

#[test]
fn a_run_s_fingerprint_holds_its_own_robot_alone() {
    let folder = example();
    let print = |run: &RunSpec| run.fingerprint(None, &versions(run.env));
    let text = fs::read_to_string(folder.path().join("robot.toml")).expect("it was copied");
    let table = text
        .split("[[matrix]]")
        .next()
        .and_then(|head| head.split_once("\n\n"))
        .expect("a table")
        .1
        .to_owned();
    let of = |table: &str| {
        planned(folder.path(), "Sled", table)
            .expect("a robot")
            .remove(0)
    };
    let run = of(&table);
    assert_eq!(print(&of(&table)), print(&run));
    assert_ne!(
        print(&of(&table.replace("= 2\n", "= 3\n"))),
        print(&run),
        "the table counts"
    );

    let hopper = |tables| {
        planned(folder.path(), "Hopper-v2", tables)
            .expect("it ships")
            .remove(0)
    };
    assert_eq!(
        print(&hopper(&table)),
        print(&hopper("")),
        "a robot changes no other run"
    );

    // Elsewhere it is the same robot, and with another model it is another one.
    let elsewhere = example();
    let there = |table: &str| {
        planned(elsewhere.path(), "Sled", table)
            .expect("a robot")
            .remove(0)
    };
    assert_eq!(print(&there(&table)), print(&run));
    let model = elsewhere.path().join("robot.xml");
    let changed = fs::read_to_string(&model)
        .expect("it was copied")
        .replace("density=\"500\"", "density=\"400\"");
    fs::write(&model, changed).expect("written");
    assert_ne!(print(&there(&table)), print(&run), "the model counts");
}

#[test]
fn what_is_recorded_needs_neither_file() {
    let folder = example();
    let program = |arguments: &[&str]| {
        let (code, text) = mcpo_run(folder.path(), arguments);
        assert_eq!(code, Some(0), "{arguments:?}: {text}");
        text
    };
    let small = [
        "--set",
        "budget.env_steps=2048",
        "--only",
        "env=Sled,algorithm=ppo,seed=0",
        "--quiet",
    ];
    program(&[&["run", "robot.toml"], &small[..]].concat());
    let run = "results/robot/runs/Sled/ppo-reward=dense/seed-0";
    assert!(folder.path().join(run).join("run.json").is_file());
    fs::remove_file(folder.path().join("robot.xml")).expect("removed");
    fs::remove_file(folder.path().join("robot.toml")).expect("removed");
    let text = program(&["reproduce", run]);
    assert!(
        text.contains("to the bit") || text.contains("reproduced"),
        "{text}"
    );
}

#[test]
fn demonstrations_of_two_robots_of_one_name_are_not_collected_together() {
    let folder = example();
    let text = fs::read_to_string(folder.path().join("robot.toml")).expect("it was copied");
    let other = text
        .replace("name        = \"robot\"", "name = \"other\"")
        .replace("frame_skip    = 2", "frame_skip = 4");
    fs::write(folder.path().join("other.toml"), other).expect("written");
    let collect = [
        "demo",
        "collect",
        "robot.toml",
        "other.toml",
        "--out",
        "demos",
        "--target",
        "9",
    ];
    let (code, text) = mcpo_run(folder.path(), &collect);
    assert_eq!(code, Some(2), "{text}");
    let told = "two files describe different robots called `Sled`";
    assert!(text.contains(told), "{text}");
    assert!(!folder.path().join("demos").exists(), "nothing is begun");
}

#[test]
fn what_another_model_left_is_not_taken_for_this_one_s() {
    let folder = example();
    let program = |arguments: &[&str]| {
        let short = ["--set", "budget.env_steps=2048"];
        let (code, text) = mcpo_run(folder.path(), &[arguments, &short].concat());
        (code == Some(0), text)
    };
    let of = |seed: &str| format!("env=Sled,algorithm=ppo,reward=dense,seed={seed}");
    let run = |seed: &str| program(&["run", "robot.toml", "--only", &of(seed), "--quiet"]);
    let report = || program(&["report", "robot.toml", "--only", &of("0,seed=1")]).1;
    let (ran, text) = run("0");
    assert!(ran, "{text}");

    let model = folder.path().join("robot.xml");
    let before = fs::read_to_string(&model).expect("it was copied");
    let changed = before.replace("density=\"500\"", "density=\"400\"");
    assert_ne!(changed, before);
    fs::write(&model, &changed).expect("written");
    let (ran, text) = run("0");
    let told = "it differs in env.model: \"robot.xml\" (content ";
    assert!(!ran && text.contains(told), "{text}");
    assert!(!text.contains("versions"), "told once: {text}");
    let text = report();
    let none = "0 of 2 runs finished; 1 was recorded with another `env.model`";
    assert!(text.contains(none), "{text}");

    // Beside the old one, the new one is the file's.
    let (ran, text) = run("1");
    assert!(ran, "{text}");
    let one = "1 of 2 runs finished; 1 was recorded with another `env.model`";
    let text = report();
    assert!(text.contains(one), "{text}");
    fs::write(&model, before).expect("written");
    let text = report();
    assert!(
        text.contains(one),
        "with the old file, the old one is: {text}"
    );
}

#[test]
fn the_documentation_says_what_the_program_does() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(source.join("experiments/environments.md")).expect("it is there");
    let blocks: Vec<&str> = text
        .split("```toml\n")
        .skip(1)
        .map(|block| block.split("```").next().unwrap_or_default())
        .collect();
    let path = source.join("examples/robot/documented.toml");
    spec::parse(&path, blocks[0], &Overrides::default())
        .expect("the first example is a matrix file");
    let hopper = fs::read_to_string(source.join("src/env/robots/hopper.toml")).expect("it ships");
    assert_eq!(blocks[1], hopper);

    let schema = schemars_of_robot();
    for key in schema["properties"].as_object().expect("keys").keys() {
        assert!(
            text.contains(&format!("\n| `{key}` |")),
            "no row of `{key}`"
        );
    }
    for env in EnvId::shipped() {
        let spaces = env.spaces().expect("a model that loads");
        let reward = toml::Value::try_from(env.default_reward())
            .expect("a reward")
            .to_string();
        let row = text
            .lines()
            .find(|line| line.starts_with(&format!("| `{env}`")))
            .expect("a row");
        let columns = format!("| {} | {} | `", spaces.observation_dim, spaces.action_dim);
        let kind = reward
            .trim_matches(['{', ' ', '"'])
            .split(['"', ' '])
            .next()
            .unwrap_or_default();
        assert!(
            row.contains(&columns) && row.contains(kind),
            "{row}: {columns}{reward}"
        );
    }
}

/// The schema of a robot's table.
fn schemars_of_robot() -> serde_json::Value {
    schemars::schema_for!(mcpo_run::env::robot::Robot).to_value()
}

/// A corridor: the position is observed, the action moves it, and its end is the goal.
struct Corridor {
    position: f64,
}

impl Environment for Corridor {
    fn spaces(&self) -> Spaces {
        Spaces {
            observation_dim: 1,
            action_dim: 1,
            action_bound: 1.0,
        }
    }

    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]) {
        self.position = rng.random_range(-0.5..0.5);
        observation[0] = self.position;
    }

    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError> {
        self.advance(action)?;
        observation[0] = self.position;
        Ok(Outcome {
            reward: self.position,
            terminated: self.position > 3.0,
        })
    }

    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError> {
        self.position += 0.1 * action[0].clamp(-1.0, 1.0);
        Ok(())
    }

    fn landmark(&self) -> f64 {
        self.position
    }

    fn pose(&self) -> Pose {
        Pose {
            qpos: vec![self.position],
            qvel: vec![],
        }
    }

    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError> {
        self.position = pose.qpos[0];
        observation[0] = self.position;
        Ok(())
    }

    fn save(&self) -> Vec<f64> {
        vec![self.position]
    }

    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError> {
        self.position = state[0];
        Ok(())
    }
}

#[test]
fn an_environment_that_the_crate_does_not_know_is_learned() {
    let corridor = || Box::new(Corridor { position: 0.0 });
    let tasks: Vec<Task> = (0..4)
        .map(|_| Task::from_environment("Corridor", corridor(), Reward::Dense, 50))
        .collect();
    let mut rng = Seed(0).stream(Stream::Network, 0);
    let agent = Agent {
        policy: GaussianPolicy::new(1, &[16], 1, 0.5, &mut rng),
        value: Mlp::new(&[1, 16, 1], 0.0, &mut rng),
        normalizer: Normalizer::new(1, 10.0),
    };
    let mut hyperparameters = trpo::Hyperparameters::for_env(EnvId::Hopper);
    hyperparameters.critic.minibatch = constant(128);
    let mut algorithm = trpo::Trpo::new(hyperparameters, agent);
    let mut rollout = Rollout::new(tasks, Seed(0));
    let mut updates = Seed(0).stream(Stream::Update, 0);
    let mut returns = Vec::new();
    for _ in 0..15 {
        let collected = rollout
            .collect(algorithm.agent_mut(), 250)
            .expect("a corridor cannot fail");
        let sum: f64 = collected
            .episodes
            .iter()
            .map(|episode| episode.dense_return)
            .sum();
        returns.push(sum / collected.episodes.len() as f64);
        algorithm
            .update(&collected.batch, &mut updates)
            .expect("an update");
    }
    let (first, last) = (returns[0], returns[14]);
    assert!(last > first + 10.0, "it learns to go forward: {returns:?}");
}
