//! The parts of a training step, timed one by one: `cargo bench --bench kernels`, or `... --
//! FILTER` for some of them.
//!
//! Rates are per second: floating-point operations for products, values for tanh, steps for
//! environments, and samples for everything else. Measurements are short by default; options such
//! as `--measurement-time 5` make them longer. Whole iterations are what `mcpo-run bench` measures.

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput};
use mcpo_run::{
    algo::{Batch, Segment, SegmentEnd, gae},
    arithmetic::{
        product::{product, product_nt},
        tanh,
    },
    demo::{Bandwidth, Estimator, Kernel, mmd::Target},
    env::{EnvId, Reward, Task},
    nn::{Fisher, GaussianPolicy, Mlp, Pass},
    quantity::Positive,
    rng::{Seed, Stream},
    solver::{
        LinearOperator,
        dual::{self, DualProblem},
    },
};
use nalgebra::DMatrix;
use rand::RngExt;

/// The sizes of HalfCheetah, and the default hidden layers.
const OBSERVATION: usize = 17;
const HIDDEN: [usize; 2] = [300, 400];
const ACTION: usize = 6;

/// A matrix of random numbers in -1..1.
fn random(rows: usize, columns: usize) -> DMatrix<f32> {
    let mut rng = Seed(1).stream(Stream::Update, 0);
    DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
}

fn policy() -> GaussianPolicy {
    GaussianPolicy::new(
        OBSERVATION,
        &HIDDEN,
        ACTION,
        0.5,
        &mut Seed(0).stream(Stream::Network, 0),
    )
}

fn products(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("product");
    for (m, k) in [(300, 17), (400, 300), (6, 400)] {
        for n in [1, 8, 64, 256, 1024] {
            let (a, b, mut c) = (random(m, k), random(k, n), DMatrix::zeros(m, n));
            group.throughput(Throughput::Elements((2 * m * k * n) as u64));
            group.bench_function(format!("{m}x{k}x{n}"), |bencher| {
                bencher.iter(|| product(a.as_view(), b.as_view(), 0.0, c.as_view_mut()));
            });
        }
    }
    let (m, k, n) = (400, 128, 300); // a weights' gradient over one chunk
    let (a, b, mut c) = (random(m, k), random(n, k), DMatrix::zeros(m, n));
    group.throughput(Throughput::Elements((2 * m * k * n) as u64));
    group.bench_function(format!("transposed {m}x{k}x{n}"), |bencher| {
        bencher.iter(|| product_nt(a.as_view(), b.as_view(), 0.0, c.as_view_mut()));
    });
}

fn elementary(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tanh");
    for n in [8 * 700, 256 * 700] {
        let mut values = random(n, 1);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(n.to_string(), |bencher| {
            bencher.iter(|| tanh(values.as_mut_slice()))
        });
    }
}

fn networks(criterion: &mut Criterion) {
    let policy = policy();
    let network = policy.mean();
    for n in [8, 1024, 4096] {
        let inputs = random(OBSERVATION, n);
        let cotangent = random(ACTION, n);
        let tangent: Vec<f32> = random(policy.dim(), 1).as_slice().to_vec();
        let (mut output, mut gradient) = (DMatrix::zeros(ACTION, n), vec![0.0; policy.dim()]);
        let mut pass = Pass::default();
        let parameters = network.parameters().len();
        let mut group = criterion.benchmark_group("network");
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(BenchmarkId::new("forward", n), |bencher| {
            bencher.iter(|| network.forward(&inputs, &mut pass));
        });
        group.bench_function(BenchmarkId::new("JVP", n), |bencher| {
            bencher.iter(|| network.jvp(&inputs, &mut pass, &tangent[..parameters], &mut output));
        });
        group.bench_function(BenchmarkId::new("VJP", n), |bencher| {
            bencher
                .iter(|| network.vjp(&inputs, &mut pass, &cotangent, &mut gradient[..parameters]));
        });
        let mut fisher = Fisher::new(&policy, &inputs, &mut pass, 1e-2);
        group.bench_function(BenchmarkId::new("Fisher product", n), |bencher| {
            bencher.iter(|| fisher.apply(&tangent, &mut gradient));
        });
    }
}

fn mmd(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("MMD");
    for n in [1000, 4000] {
        let (points, samples) = (
            random(OBSERVATION + ACTION, n),
            random(OBSERVATION + ACTION, n),
        );
        let kernel = Kernel::new(
            Bandwidth::Fixed(Positive::try_from(1.0).expect("above 0")),
            &points,
        );
        let target = Target::new(points, kernel, Estimator::V);
        let actions = samples.rows(OBSERVATION, ACTION).into_owned();
        let mut gradient = DMatrix::zeros(ACTION, n);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(BenchmarkId::new("value", n), |bencher| {
            bencher.iter(|| target.mmd_squared(&samples))
        });
        group.bench_function(BenchmarkId::new("value at its states", n), |bencher| {
            bencher.iter(|| target.mmd_squared_at_states(&actions))
        });
        group.bench_function(BenchmarkId::new("gradient at its states", n), |bencher| {
            bencher.iter(|| target.mmd_squared_at_states_gradient(&actions, &mut gradient));
        });
    }
}

fn advantages(criterion: &mut Criterion) {
    const N: usize = 4096;
    let observations = random(OBSERVATION, N);
    let last_observation = observations.column(0).as_slice().to_vec();
    let segment = |start| Segment {
        range: start..start + N / 8,
        end: SegmentEnd::Bootstrapped {
            last_observation: last_observation.clone(),
        },
    };
    let batch = Batch {
        raw_observations: DMatrix::zeros(OBSERVATION, 0),
        means: DMatrix::zeros(ACTION, 0),
        actions: random(ACTION, N),
        rewards: vec![1.0; N],
        segments: (0..N).step_by(N / 8).map(segment).collect(),
        observations,
    };
    let widths = [&[OBSERVATION][..], &HIDDEN, &[1]].concat();
    let value = Mlp::new(&widths, 1.0, &mut Seed(0).stream(Stream::Network, 0));
    let mut pass = Pass::default();
    let mut group = criterion.benchmark_group("GAE");
    group.throughput(Throughput::Elements(N as u64));
    group.bench_function(N.to_string(), |bencher| {
        bencher.iter(|| gae::estimate(&batch, &batch.rewards, &value, 0.99, 0.95, &mut pass));
    });
}

fn duals(criterion: &mut Criterion) {
    let problem = DualProblem {
        q: 2.0,
        r: -0.7,
        s: 1.3,
        slack: -0.05,
        radius: 5e-3,
    };
    criterion.bench_function("dual", |bencher| {
        bencher.iter(|| dual::solve(black_box(&problem)))
    });
}

/// Uniform actions; episodes begin anew where they end.
fn environments(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("step");
    group.throughput(Throughput::Elements(1));
    for env in EnvId::ALL {
        let mut task =
            Task::new(env, Reward::Dense, env.max_steps()).expect("the engine takes its model");
        let spaces = task.spaces();
        let mut rng = Seed(0).stream(Stream::Environment, 0);
        let mut observation = vec![0.0; spaces.observation_dim];
        let mut action = vec![0.0; spaces.action_dim];
        task.reset(&mut rng, &mut observation);
        group.bench_function(env.name(), |bencher| {
            bencher.iter(|| {
                let bound = spaces.action_bound;
                action
                    .iter_mut()
                    .for_each(|a| *a = rng.random_range(-bound..=bound));
                if task
                    .step(&action, &mut observation)
                    .expect("the physics holds")
                    .end
                    .is_some()
                {
                    task.reset(&mut rng, &mut observation);
                }
            });
        });
    }
}

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(400))
        .without_plots()
        .configure_from_args();
    for part in [
        products,
        elementary,
        networks,
        mmd,
        advantages,
        duals,
        environments,
    ] {
        part(&mut criterion);
    }
    criterion.final_summary();
}
