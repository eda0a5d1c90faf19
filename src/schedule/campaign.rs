//! The queue: starts the due runs, longest first, listens to the workers, and records what they
//! could not record themselves.

use std::{
    collections::{BTreeMap, VecDeque},
    io,
    path::Path,
    time::{Duration, Instant},
};

use super::{
    Executor,
    cost::CostModel,
    event::{Event, Job, Message},
    failure::{self, Found},
    progress::{Progress, clock},
    state::{Planned, RunState},
    stop::StopRequest,
};
use crate::record::Claim;

/// The pause between two rounds of the loop.
const TICK: Duration = Duration::from_millis(100);
/// A longer pause does not come from the loop: the program itself stood still, stopped by Ctrl-Z or
/// together with the whole machine.
const STOOD_STILL: Duration = Duration::from_secs(1);
/// The pause between two looks at the runs of other processes.
const LOOK_AROUND: Duration = Duration::from_secs(1);

/// How runs are started and how patient the program is with them.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Runs at a time.
    pub jobs: usize,
    /// Threads that share a run's work. `None`: one thread each; when fewer runs than `jobs` are
    /// left, the last ones to start share the free places.
    pub threads: Option<usize>,
    /// How often a run that failed is tried again, each time from its last checkpoint.
    pub retries: u32,
    /// Whether the first failure stops everything.
    pub fail_fast: bool,
    /// A worker that is silent for this long is killed.
    pub hang_timeout: Duration,
    /// Whether logs hold every iteration.
    pub verbose: bool,
}

/// A worker that is silent for this long is killed, unless another time is asked for.
pub const HANG_TIMEOUT: Duration = Duration::from_secs(600);

impl Options {
    /// `jobs` runs at a time, each tried once, whatever becomes of the others.
    pub fn new(jobs: usize) -> Self {
        Self {
            jobs,
            threads: None,
            retries: 0,
            fail_fast: false,
            hang_timeout: HANG_TIMEOUT,
            verbose: false,
        }
    }
}

/// The outcome of the runs that were due.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Summary {
    /// The number of runs that finished, in this process or another.
    pub finished: usize,
    /// The ids and errors of those that failed.
    pub failed: Vec<(String, String)>,
    /// The number of runs that were stopped or not begun.
    pub left: usize,
    /// Whether somebody asked for a stop.
    pub interrupted: bool,
}

/// Runs `due` on `executor` until every run has ended, or a stop is asked for.
pub fn run(
    due: &[Planned],
    results: &Path,
    options: Options,
    costs: &CostModel,
    executor: &mut dyn Executor,
    stop: &StopRequest,
    progress: &mut Progress,
) -> Summary {
    let mut queue: Vec<usize> = (0..due.len()).collect();
    // Longest first, so that no long run is left alone at the end; the plan's order among equals.
    queue.sort_by(|&a, &b| {
        costs
            .seconds(&due[b].spec)
            .total_cmp(&costs.seconds(&due[a].spec))
    });
    let campaign = Campaign {
        due,
        results,
        options,
        costs,
        executor,
        progress,
        queue: queue.into(),
        running: BTreeMap::new(),
        elsewhere: Vec::new(),
        looked_around: Instant::now(),
        looked: Instant::now(),
        failures: vec![0; due.len()],
        stopping: false,
        summary: Summary::default(),
    };
    campaign.run(stop)
}

struct Campaign<'a> {
    due: &'a [Planned],
    results: &'a Path,
    options: Options,
    costs: &'a CostModel,
    executor: &'a mut dyn Executor,
    progress: &'a mut Progress,
    /// Waiting runs, by their index in `due`.
    queue: VecDeque<usize>,
    running: BTreeMap<usize, Worker>,
    /// Runs that another process has claimed.
    elsewhere: Vec<usize>,
    looked_around: Instant,
    /// When the workers were last looked at.
    looked: Instant,
    /// How often each run has failed in this call.
    failures: Vec<u32>,
    stopping: bool,
    summary: Summary,
}

/// Whether the system has run out of files, processes, threads or memory for now.
fn is_exhaustion(error: &io::Error) -> bool {
    #[cfg(unix)]
    {
        use rustix::io::Errno;
        let exhausted = [Errno::MFILE, Errno::NFILE, Errno::AGAIN, Errno::NOMEM];
        Errno::from_io_error(error).is_some_and(|errno| exhausted.contains(&errno))
    }
    #[cfg(not(unix))]
    {
        error.kind() == io::ErrorKind::OutOfMemory
    }
}

/// A job under way.
struct Worker {
    began: Instant,
    /// How long it has been silent while the campaign listened.
    silent: Duration,
    /// Environment steps so far; absent until it has begun.
    env_steps: Option<u64>,
    last_return: Option<f64>,
    /// Its final event: finished, stopped, claimed or failed.
    verdict: Option<Event>,
    hung: bool,
}

impl Worker {
    /// The message about a worker that has finished.
    fn finished(&self) -> String {
        let mean = self
            .last_return
            .map_or_else(String::new, |mean| format!(", return {mean:.1}"));
        format!(
            "finished in {}{mean}",
            clock(self.began.elapsed().as_secs_f64())
        )
    }
}

impl Campaign<'_> {
    fn run(mut self, stop: &StopRequest) -> Summary {
        loop {
            if stop.is_made() && !self.summary.interrupted {
                self.summary.interrupted = true;
                self.stop(
                    "stopping: the runs under way write a checkpoint; once more to leave at once",
                );
            }
            while !self.stopping && self.running.len() < self.options.jobs {
                let Some(number) = self.queue.pop_front() else {
                    break;
                };
                self.start(number);
            }
            let nothing_waits = self.stopping || self.queue.is_empty() && self.elsewhere.is_empty();
            if self.running.is_empty() && nothing_waits {
                break;
            }
            match self.executor.wait(TICK) {
                Some((number, Message::Event(event))) => self.hear(number, event),
                Some((number, Message::Exited { how, stderr })) => self.end(number, &how, &stderr),
                None => {}
            }
            self.kill_hung();
            self.look_around();
            self.progress.tick();
        }
        self.summary.left = self.due.len() - self.summary.finished - self.summary.failed.len();
        self.progress.close();
        self.summary
    }

    fn stop(&mut self, why: &str) {
        self.stopping = true;
        if !self.running.is_empty() {
            self.progress.say(why);
        }
        for &number in self.running.keys() {
            self.executor.stop(number);
        }
    }

    fn start(&mut self, number: usize) {
        let run = &self.due[number];
        let Options {
            jobs,
            threads,
            verbose,
            ..
        } = self.options;
        // With fewer runs left than jobs, those that are left share the idle threads.
        let left = self.running.len() + 1 + self.queue.len();
        let threads = threads.unwrap_or((jobs / left).max(1));
        let job = Job {
            results: self.results.into(),
            stamp: run.stamp.clone(),
            verbose,
            threads,
        };
        match self.executor.start(number, &job) {
            Ok(()) => {
                let worker = Worker {
                    began: Instant::now(),
                    silent: Duration::ZERO,
                    env_steps: None,
                    last_return: None,
                    verdict: None,
                    hung: false,
                };
                self.running.insert(number, worker);
            }
            Err(error) if is_exhaustion(&error) && !self.running.is_empty() => {
                // Running jobs will free what is missing, so the run waits instead of failing.
                self.options.jobs = self.running.len();
                self.queue.push_front(number);
                let jobs = self.options.jobs;
                self.progress.complain(&format!(
                    "no more than {jobs} at a time from here on: {error}"
                ));
            }
            Err(error) => self.fail(
                number,
                None,
                &format!("cannot start a process for it: {error}"),
                &[],
            ),
        }
    }

    fn hear(&mut self, number: usize, event: Event) {
        let Some(worker) = self.running.get_mut(&number) else {
            return;
        };
        worker.silent = Duration::ZERO;
        match event {
            Event::Began { from_env_steps } => {
                worker.env_steps = Some(from_env_steps);
                let spec = &self.due[number].spec;
                let (steps, seconds) = (spec.trained_steps(), self.costs.seconds(spec));
                self.progress
                    .begin(number, &spec.id, from_env_steps, steps, seconds);
            }
            Event::Iteration {
                env_steps,
                training_return,
            } => {
                worker.env_steps = Some(env_steps);
                self.progress.iteration(number, env_steps, training_return);
            }
            Event::Evaluation {
                env_steps,
                dense_return,
                last,
            } => {
                worker.last_return = last.then_some(dense_return);
                self.progress.evaluation(number, env_steps, dense_return);
            }
            Event::Warned { text } => self
                .progress
                .complain(&format!("{}: {text}", self.due[number].spec.id)),
            Event::Alive => {}
            verdict => worker.verdict = Some(verdict),
        }
    }

    fn end(&mut self, number: usize, how: &str, stderr: &[String]) {
        let Some(worker) = self.running.remove(&number) else {
            return;
        };
        match &worker.verdict {
            Some(Event::Finished) => self.finish(number, &worker.finished()),
            Some(Event::Stopped) => {
                self.progress.leave(number);
                if !self.stopping {
                    // Somebody stopped this run alone, and will know why.
                    self.progress.complain(&format!(
                        "{}: stopped from outside",
                        self.due[number].spec.id
                    ));
                }
            }
            Some(Event::Claimed) => self.leave(number),
            Some(Event::Failed { error }) => self.fail(number, Some(&worker), error, stderr),
            // A second Ctrl-C reaches the workers too.
            _ if self.stopping && !worker.hung => match self.due[number].state() {
                Ok(RunState::Finished(_)) => self.finish(number, &worker.finished()),
                _ => self.progress.leave(number),
            },
            _ => {
                let cause = if worker.hung {
                    format!(
                        "no progress for {} s, then killed",
                        self.options.hang_timeout.as_secs()
                    )
                } else {
                    failure::cause(how, stderr)
                };
                self.fail(number, Some(&worker), &cause, stderr);
            }
        }
    }

    /// Counts a run as finished, and shows `how`.
    fn finish(&mut self, number: usize, how: &str) {
        self.summary.finished += 1;
        self.progress.end(number);
        self.progress
            .say(&format!("{}: {how}", self.due[number].spec.id));
    }

    /// Leaves a run to the process that has claimed it.
    fn leave(&mut self, number: usize) {
        self.progress.leave(number);
        self.progress.say(&format!(
            "{}: another process works on it",
            self.due[number].spec.id
        ));
        self.elsewhere.push(number);
    }

    /// Records a failure, and queues the run again where retries are left. `worker` is absent where
    /// no process could be started.
    fn fail(&mut self, number: usize, worker: Option<&Worker>, error: &str, stderr: &[String]) {
        let run = &self.due[number];
        // While stopping, nothing is begun again.
        let again = !self.stopping && self.failures[number] < self.options.retries;
        let kept = failure::record(
            run,
            error,
            stderr,
            worker.and_then(|worker| worker.env_steps),
            !again,
        );
        match kept {
            // Its process died after it had recorded the run and before it could say so.
            Ok(Found::Finished) => {
                let here =
                    worker.map(|worker| format!("{}; after that: {error}", worker.finished()));
                return self.finish(
                    number,
                    here.as_deref().unwrap_or("finished by another process"),
                );
            }
            // The process that has claimed it will record how it ends.
            Ok(Found::TakenUp) => return self.leave(number),
            Ok(Found::Failed) | Err(_) => {}
        }
        if let Err(refused) = kept {
            self.progress.complain(&format!(
                "{}: the failure cannot be recorded: {refused}",
                run.spec.id
            ));
        }
        self.failures[number] += 1;
        if again {
            self.progress.leave(number);
            let (failed, retries) = (self.failures[number], self.options.retries);
            self.progress.complain(&format!(
                "{}: {error}; trying again ({failed} of {retries})",
                run.spec.id
            ));
            self.queue.push_front(number);
            return;
        }
        self.progress.end(number);
        self.progress
            .complain(&format!("{}: failed: {error}", run.spec.id));
        self.summary
            .failed
            .push((run.spec.id.clone(), error.to_owned()));
        if self.options.fail_fast && !self.stopping {
            self.stop("stopping after the first failure: the other runs write a checkpoint");
        }
    }

    fn kill_hung(&mut self) {
        let now = Instant::now();
        let passed = now.duration_since(self.looked).min(STOOD_STILL);
        self.looked = now;
        for (&number, worker) in &mut self.running {
            worker.silent += passed;
            if !worker.hung && worker.silent >= self.options.hang_timeout {
                worker.hung = true;
                self.executor.kill(number);
            }
        }
    }

    /// Puts a run into the queue, behind those that will take as long or longer.
    fn queue_up(&mut self, number: usize) {
        let seconds = |number: usize| self.costs.seconds(&self.due[number].spec);
        let place = self
            .queue
            .partition_point(|&waiting| seconds(waiting) >= seconds(number));
        self.queue.insert(place, number);
    }

    /// Takes over runs that other processes have let go of.
    fn look_around(&mut self) {
        if self.looked_around.elapsed() < LOOK_AROUND {
            return;
        }
        self.looked_around = Instant::now();
        for number in std::mem::take(&mut self.elsewhere) {
            let run = &self.due[number];
            // If the claim cannot be read, a worker will report why.
            if matches!(Claim::is_held(&run.paths), Ok(true)) {
                self.elsewhere.push(number);
                continue;
            }
            match run.state() {
                Ok(RunState::Finished(_)) => self.finish(number, "finished by another process"),
                Ok(RunState::Failed(manifest)) => {
                    let error = manifest.error().unwrap_or("it did not end").to_owned();
                    self.progress.end(number);
                    self.progress.complain(&format!(
                        "{}: failed in another process: {error}",
                        run.spec.id
                    ));
                    self.summary.failed.push((run.spec.id.clone(), error));
                }
                _ => self.queue_up(number),
            }
        }
    }
}

#[cfg(test)]
mod tests;
