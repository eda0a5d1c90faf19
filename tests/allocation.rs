//! A step in the environment takes no memory from the system.
//!
//! Precisely: a rollout allocates a fixed number of times, which depends neither on how many steps
//! it takes nor on how many samples that makes, and no more than [`PER_EPISODE`] times for each
//! episode that ends in it. MuJoCo's own memory is not Rust's and not counted; its simulations have
//! an arena of their own.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use mcpo_run::{
    algo::Agent,
    env::{EnvId, Reward, Task},
    nn::{GaussianPolicy, Mlp, Normalizer},
    rng::{Seed, Stream},
    train::rollout::Rollout,
};

/// An episode's segment and returns, in lists that may have to grow, and the observation after it.
const PER_EPISODE: u64 = 3;

const LANES: usize = 4;

thread_local! {
    /// Allocations of this thread; other threads of the test harness have their own.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counted.
struct Counting;

#[expect(
    unsafe_code,
    reason = "an allocator is unsafe by its definition; every call is handed on as it came"
)]
// SAFETY: the system's allocator keeps the contract, and counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A rollout of `env`'s under way, and who acts in it.
fn begun(env: EnvId) -> (Rollout, Agent) {
    let tasks: Vec<Task> = (0..LANES)
        .map(|_| Task::new(env, Reward::Dense, env.max_steps()).expect("a task"))
        .collect();
    let spaces = tasks[0].spaces();
    let mut rng = Seed(0).stream(Stream::Network, 0);
    let mut agent = Agent {
        policy: GaussianPolicy::new(
            spaces.observation_dim,
            &[32, 32],
            spaces.action_dim,
            0.5,
            &mut rng,
        ),
        value: Mlp::new(&[spaces.observation_dim, 32, 32, 1], 0.0, &mut rng),
        normalizer: Normalizer::new(spaces.observation_dim, 10.0),
    };
    let mut rollout = Rollout::new(tasks, Seed(0));
    rollout.collect(&mut agent, 1).expect("physics"); // its buffers are made once
    (rollout, agent)
}

/// Allocations of a rollout of `steps`, and the episodes that end in it.
fn counted(env: EnvId, steps: usize) -> (u64, u64) {
    let (mut rollout, mut agent) = begun(env);
    let before = ALLOCATIONS.get();
    let collected = rollout.collect(&mut agent, steps).expect("physics");
    (ALLOCATIONS.get() - before, collected.episodes.len() as u64)
}

#[test]
fn what_is_allocated_is_counted() {
    let before = ALLOCATIONS.get();
    let mut numbers = Vec::with_capacity(1);
    numbers.extend([1u8, 2, 3]);
    assert_eq!((ALLOCATIONS.get() - before, numbers.len()), (2, 3));
}

#[test]
fn a_rollout_of_more_steps_allocates_as_often_as_one_of_few() {
    for env in EnvId::ALL {
        let (of_few, few_episodes) = counted(env, 3);
        assert_eq!(few_episodes, 0, "{env}: three steps are no episode");
        assert!(of_few > 0, "{env}: the batch itself is allocated");
        for steps in [300, 600] {
            let (allocations, episodes) = counted(env, steps);
            let most = of_few + PER_EPISODE * episodes;
            assert!(
                allocations <= most,
                "{env}, {steps} steps: {allocations} allocations, {episodes} episodes, {of_few} without"
            );
            // Where nothing ends, the number is the same.
            assert!(
                episodes > 0 || allocations == of_few,
                "{env}, {steps} steps: {allocations} instead of {of_few}"
            );
        }
    }
}

#[test]
fn some_tasks_end_in_this_time_and_some_do_not() {
    // So that the test above sees both.
    assert_eq!(counted(EnvId::HalfCheetah, 600).1, 0);
    assert!(counted(EnvId::Hopper, 600).1 > 10);
}
