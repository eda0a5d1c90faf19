//! The cost of shortcuts in the natural gradient, in the quality of the step that they find: `cargo
//! bench --bench shortcuts`.
//!
//! The batches come from MCPO while it trains on the dense reward. On them, `H^-1 v` is computed
//! for its two gradients: v = g of the surrogate, and v = b of the MMD at the demonstration's
//! states. Each row says how many samples are in the Fisher matrix and how many products are taken.
//! It prints the gain `v.x` as a share of the best at the same KL, and the mean KL of the step in
//! units of the requested one, both by the quadratic model of all samples. The best is the result
//! of 300 products with all samples. A warm start continues from the result of 10 products with all
//! samples an iteration earlier, scaled to its best length, which costs one product. The numbers
//! are means over the batches, with the lowest gain and the highest KL in brackets.
//! `experiments/studies/shortcuts` tells the conclusions.

use std::{error::Error, path::Path};

use mcpo_run::{
    algo::{
        Agent, Batch, OnPolicy, gae,
        mcpo::{self, Mcpo},
        mimicry::Mimicry,
        trust_region::Surrogate,
    },
    demo::Demonstration,
    nn::{Fisher, Pass},
    plan::{self, RunSpec},
    rng::{Seed, Stream},
    solver::{
        LinearOperator,
        conjugate_gradient::{Limits, solve},
        dot,
    },
    spec::{self, Overrides},
    train::{build, rollout::Rollout},
};
use nalgebra::DMatrix;

/// The iterations whose batches are measured.
const ITERATIONS: [usize; 3] = [2, 10, 30];
/// The numbers of samples in the Fisher matrix.
const SAMPLES: [usize; 5] = [4096, 2048, 1024, 512, 256]; // the first is all
/// The numbers of products with the Fisher matrix.
const PRODUCTS: [usize; 5] = [3, 5, 10, 15, 20];
/// The limits under which the best solution is found.
const ENOUGH: Limits = limits(300);

const fn limits(iterations: usize) -> Limits {
    Limits {
        iterations,
        relative_residual: 0.0,
    }
}

#[expect(clippy::print_stdout, reason = "it is what this program is for")]
fn main() -> Result<(), Box<dyn Error>> {
    for env in ["HalfCheetah-v2", "Hopper-v2", "Ant-v2"] {
        let cases = study(env)?;
        println!("\n{env}, iterations {ITERATIONS:?}\n");
        println!(
            "| Fisher samples | products | residual of g | gain of g | KL of g | gain of b | KL of b |"
        );
        println!("|---|---:|---:|---:|---:|---:|---:|");
        for case in &cases {
            let warm = if case.is_warm { ", warm" } else { "" };
            println!(
                "| {}{warm} | {} | {} |",
                case.samples,
                case.products,
                case.cells()
            );
        }
    }
    Ok(())
}

/// One printed row, with the qualities for g and for b on each batch.
struct Case {
    samples: usize,
    is_warm: bool,
    products: usize,
    of_g: Vec<Quality>,
    of_b: Vec<Quality>,
}

/// The quality of a solution.
struct Quality {
    /// The relative residual that conjugate gradient itself reports.
    residual: f64,
    /// The gain as a share of the best at the same KL.
    gain: f64,
    /// The mean KL in units of the requested one.
    kl: f64,
}

impl Case {
    fn cells(&self) -> String {
        let mean = |of: &[Quality], what: fn(&Quality) -> f64| {
            of.iter().map(what).sum::<f64>() / of.len() as f64
        };
        let gain = |of: &[Quality]| {
            let lowest = of
                .iter()
                .map(|quality| quality.gain)
                .fold(f64::INFINITY, f64::min);
            format!(
                "{:.0}% ({:.0}%)",
                100.0 * mean(of, |quality| quality.gain),
                100.0 * lowest
            )
        };
        let kl = |of: &[Quality]| {
            let highest = of.iter().map(|quality| quality.kl).fold(0.0, f64::max);
            format!("{:.2} ({highest:.2})", mean(of, |quality| quality.kl))
        };
        let residual = mean(&self.of_g, |quality| quality.residual);
        [
            format!("{residual:.2}"),
            gain(&self.of_g),
            kl(&self.of_g),
            gain(&self.of_b),
            kl(&self.of_b),
        ]
        .join(" | ")
    }
}

fn study(env: &str) -> Result<Vec<Case>, Box<dyn Error>> {
    let text = format!(
        "name = 'shortcuts'\nreward = 'dense'\nbudget.env_steps = 1_000_000\n\
         [[matrix]]\nseed = [0]\nenv = ['{env}']\nalgorithm = ['mcpo']\n"
    );
    let spec = spec::parse(
        Path::new("experiments/shortcuts.toml"),
        &text,
        &Overrides::default(),
    )?;
    let spec: RunSpec = plan::plan(&spec)?.remove(0);
    let h: mcpo::Hyperparameters = spec.algorithm.hyperparameters().try_into()?;
    let tasks = build::tasks(&spec, spec.rollout.environments.size())?;
    let steps = spec.rollout.steps.size() / tasks.len();
    let agent = build::agent(&spec, tasks[0].spaces());
    let path = spec
        .demonstration
        .as_deref()
        .ok_or("MCPO has a demonstration")?;
    let demonstration = Demonstration::read_for(path, spec.env)?;
    let mut mcpo = Mcpo::new(h.clone(), agent, &demonstration, spec.seed);
    let mut mimicry = Mimicry::new(
        h.mmd.clone(),
        &demonstration,
        mcpo.agent().hidden(),
        spec.seed,
    );
    let mut rollout = Rollout::new(tasks, spec.seed);
    let mut updates = spec.seed.stream(Stream::Update, 0);

    let case = |samples, is_warm, products| Case {
        samples,
        is_warm,
        products,
        of_g: Vec::new(),
        of_b: Vec::new(),
    };
    let cold = SAMPLES
        .iter()
        .flat_map(|&samples| PRODUCTS.map(|products| case(samples, false, products)));
    let mut cases: Vec<Case> = cold
        .chain(PRODUCTS.map(|products| case(SAMPLES[0], true, products)))
        .collect();
    let mut before: Option<[Vec<f32>; 2]> = None;
    for iteration in 1..=ITERATIONS[ITERATIONS.len() - 1] {
        let batch = rollout.collect(mcpo.agent_mut(), steps)?.batch;
        // The iteration before each measured one is solved too: a warm start continues from it.
        let wanted = |i: &usize| *i == iteration || *i == iteration + 1;
        if ITERATIONS.iter().any(wanted) {
            let gradients = gradients(mcpo.agent(), &batch, &mut mimicry, &h)?;
            let problem = Problem::new(mcpo.agent(), &batch, h.region.damping.get());
            if let Some(before) = before.take() {
                let best = [0, 1].map(|i| {
                    dot(
                        &gradients[i],
                        &problem.solved(&batch.observations, &gradients[i], ENOUGH).0,
                    )
                });
                for case in &mut cases {
                    case.of_g
                        .push(problem.quality(case, &gradients[0], &before[0], best[0]));
                    case.of_b
                        .push(problem.quality(case, &gradients[1], &before[1], best[1]));
                }
            }
            before = Some(gradients.map(|v| problem.solved(&batch.observations, &v, limits(10)).0));
        }
        mcpo.update(&batch, &mut updates)?;
    }
    Ok(cases)
}

/// The two gradients: g of the surrogate, and b of the MMD.
fn gradients(
    agent: &Agent,
    batch: &Batch,
    mimicry: &mut Mimicry,
    h: &mcpo::Hyperparameters,
) -> Result<[Vec<f32>; 2], Box<dyn Error>> {
    let (discount, lambda) = (h.critic.discount.get(), h.critic.gae_lambda.get());
    let (mut pass, mut value_pass) = (Pass::default(), Pass::default());
    let estimate = gae::estimate(
        batch,
        &batch.rewards,
        &agent.value,
        discount,
        lambda,
        &mut value_pass,
    );
    let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, &mut pass);
    let g = surrogate.gradient(&agent.policy, &mut pass);
    let mut unused = Seed(0).stream(Stream::Update, 0);
    let measured = mimicry.measure(agent, &surrogate, &mut pass, &h.critic, &mut unused)?;
    Ok([g, measured.gradient])
}

/// The policy and the samples whose Fisher matrix counts.
struct Problem<'a> {
    agent: &'a Agent,
    all: &'a DMatrix<f32>,
    damping: f64,
}

impl<'a> Problem<'a> {
    fn new(agent: &'a Agent, batch: &'a Batch, damping: f64) -> Self {
        Self {
            agent,
            all: &batch.observations,
            damping,
        }
    }

    /// The solution of conjugate gradient with the Fisher matrix of `observations`, and its
    /// residual.
    fn solved(&self, observations: &DMatrix<f32>, v: &[f32], limits: Limits) -> (Vec<f32>, f64) {
        let mut pass = Pass::default();
        self.agent.policy.forward(observations, &mut pass);
        let mut fisher = Fisher::new(&self.agent.policy, observations, &mut pass, self.damping);
        let solution = solve(&mut fisher, v, limits);
        (solution.x, solution.relative_residual)
    }

    /// The product of all samples' Fisher matrix with `x`.
    fn product(&self, x: &[f32]) -> Vec<f32> {
        let mut pass = Pass::default();
        self.agent.policy.forward(self.all, &mut pass);
        let mut product = vec![0.0; x.len()];
        Fisher::new(&self.agent.policy, self.all, &mut pass, self.damping).apply(x, &mut product);
        product
    }

    /// The quality of `case`'s solution for `v`. The best solution has `v.x = best`; the previous
    /// iteration had found `before`.
    fn quality(&self, case: &Case, v: &[f32], before: &[f32], best: f64) -> Quality {
        let (x, residual) = if case.is_warm {
            let moved = self.product(before);
            let length = (dot(before, v) / dot(before, &moved)) as f32;
            let left: Vec<f32> = v
                .iter()
                .zip(&moved)
                .map(|(v, moved)| v - length * moved)
                .collect();
            let (more, residual) = self.solved(self.all, &left, limits(case.products - 1));
            let x = before
                .iter()
                .zip(&more)
                .map(|(x, more)| length * x + more)
                .collect();
            (x, residual * (dot(&left, &left) / dot(v, v)).sqrt())
        } else {
            let some = self
                .all
                .columns_with_step(0, case.samples, self.all.ncols() / case.samples - 1)
                .into_owned();
            self.solved(&some, v, limits(case.products))
        };
        let (gain, square) = (dot(v, &x), dot(&x, &self.product(&x)));
        // The step is scaled by the KL in its own model, which is v.x / 2.
        Quality {
            residual,
            gain: gain / (square * best).sqrt(),
            kl: square / gain,
        }
    }
}
