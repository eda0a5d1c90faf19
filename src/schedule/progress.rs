//! The display of a campaign's progress: one bar per run and one for the whole, or a plain line now
//! and then.

use std::{
    collections::BTreeMap,
    io::{self, IsTerminal, Write},
    time::{Duration, Instant},
};

use crate::escape;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// The time between two plain lines; ends of runs are shown at once.
const LINE_INTERVAL: Duration = Duration::from_secs(20);

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Bars that are redrawn, for a terminal.
    Bars,
    /// Lines, for a file or a pipe.
    Lines,
    /// Only failures.
    Quiet,
}

impl Style {
    /// The style for this stderr: bars on a terminal, otherwise lines; only failures if `quiet`.
    pub fn choose(quiet: bool) -> Self {
        match (quiet, io::stderr().is_terminal()) {
            (true, _) => Self::Quiet,
            (false, true) => Self::Bars,
            (false, false) => Self::Lines,
        }
    }
}

/// The progress of a campaign, as shown on stderr.
#[derive(Debug)]
pub struct Progress {
    style: Style,
    verbose: bool,
    screen: MultiProgress,
    whole: ProgressBar,
    began: Instant,
    last_line: Instant,
    ended: usize,
    /// Expected seconds of work that are left of each run; `work_done` are those done since the
    /// beginning.
    left: Vec<f64>,
    work_done: f64,
    steps_done: u64,
    running: BTreeMap<usize, Running>,
}

#[derive(Debug)]
struct Running {
    label: String,
    bar: ProgressBar,
    began: Instant,
    budget: u64,
    from: u64,
    env_steps: u64,
    work_per_step: f64,
    last_return: Option<f64>,
}

impl Running {
    fn steps_per_second(&self) -> f64 {
        (self.env_steps - self.from) as f64 / self.began.elapsed().as_secs_f64().max(1e-3)
    }

    fn seconds_left(&self) -> Option<f64> {
        let speed = self.steps_per_second();
        (speed > 0.0).then(|| self.budget.saturating_sub(self.env_steps) as f64 / speed)
    }
}

impl Progress {
    /// Shows a campaign of runs; what is left of each would take so many seconds in one process.
    pub fn new(style: Style, verbose: bool, left: Vec<f64>) -> Self {
        let target = if style == Style::Bars {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let screen = MultiProgress::with_draw_target(target);
        let whole = screen.add(ProgressBar::new(1000));
        whole.set_style(bar_style("{bar:12.green} {percent:>3} %  {wide_msg}"));
        Self {
            style,
            verbose,
            screen,
            whole,
            began: Instant::now(),
            last_line: Instant::now(),
            ended: 0,
            left,
            work_done: 0.0,
            steps_done: 0,
            running: BTreeMap::new(),
        }
    }

    /// Shows that run `number` begins at `from` of `steps` environment steps. The whole run would
    /// take `seconds`.
    pub fn begin(&mut self, number: usize, label: &str, from: u64, steps: u64, seconds: f64) {
        let budget = steps.max(1); // some runs take no steps
        let bar = self
            .screen
            .insert_before(&self.whole, ProgressBar::new(budget));
        bar.set_style(bar_style("{bar:12} {percent:>3} %  {wide_msg}"));
        bar.set_message(label.to_owned());
        let work_per_step = seconds / budget as f64;
        self.left[number] = work_per_step * budget.saturating_sub(from) as f64;
        let running = Running {
            label: label.to_owned(),
            bar,
            began: Instant::now(),
            budget,
            from,
            env_steps: from,
            work_per_step,
            last_return: None,
        };
        self.running.insert(number, running);
    }

    /// Shows that run `number` has reached `env_steps`.
    pub fn iteration(&mut self, number: usize, env_steps: u64, training_return: Option<f64>) {
        let Some(run) = self.running.get_mut(&number) else {
            return;
        };
        let steps = env_steps.saturating_sub(run.env_steps);
        self.steps_done += steps;
        let work = run.work_per_step * steps as f64;
        self.work_done += work;
        self.left[number] -= work;
        run.env_steps = env_steps;
        run.last_return = training_return.or(run.last_return);
        run.bar.set_position(env_steps.min(run.budget));
        // The changing parts come first, since narrow terminals cut off the end.
        let left = run
            .seconds_left()
            .map_or_else(String::new, |seconds| format!("{} left, ", clock(seconds)));
        let mean = run
            .last_return
            .map_or_else(String::new, |mean| format!(", training return {mean:.1}"));
        run.bar.set_message(format!(
            "{left}{} steps/s  {}{mean}",
            thousands(run.steps_per_second()),
            run.label
        ));
    }

    /// Shows an evaluation of run `number`.
    pub fn evaluation(&mut self, number: usize, env_steps: u64, dense_return: f64) {
        let Some(run) = self.running.get(&number).filter(|_| self.verbose) else {
            return;
        };
        self.say(&format!(
            "{} at {} steps: dense return {dense_return:.2}",
            run.label,
            thousands(env_steps as f64)
        ));
    }

    /// Shows that run `number` has ended, here or in another process.
    pub fn end(&mut self, number: usize) {
        self.ended += 1;
        self.left[number] = 0.0;
        self.remove(number);
    }

    /// Removes run `number`, which is no longer under way here and has not ended.
    pub fn leave(&mut self, number: usize) {
        if let Some(run) = self.remove(number) {
            // It will begin again, and say where.
            self.left[number] = run.work_per_step * run.budget as f64;
        }
    }

    fn remove(&mut self, number: usize) -> Option<Running> {
        let run = self.running.remove(&number)?;
        run.bar.finish_and_clear();
        self.screen.remove(&run.bar);
        Some(run)
    }

    /// Redraws the bar of the whole, or writes a line when one is due; to be called a few times a
    /// second.
    pub fn tick(&mut self) {
        let status = self.status();
        let share = self.work_done / (self.work_done + self.work_left()).max(1e-9);
        self.whole.set_position((1000.0 * share) as u64);
        self.whole.set_message(status.clone());
        if self.style == Style::Lines && self.last_line.elapsed() >= LINE_INTERVAL {
            self.last_line = Instant::now();
            self.say(&status);
        }
    }

    /// One line with runs, speed and time left.
    pub(super) fn status(&self) -> String {
        let elapsed = self.began.elapsed().as_secs_f64().max(1e-3);
        let speed = thousands(self.steps_done as f64 / elapsed);
        // The whole ends at the rate of work so far, but not before the slowest of the running
        // ones.
        let by_work = (self.work_done > 0.0).then(|| self.work_left() * elapsed / self.work_done);
        let slowest = self
            .running
            .values()
            .filter_map(Running::seconds_left)
            .reduce(f64::max);
        let left = match by_work.into_iter().chain(slowest).reduce(f64::max) {
            Some(seconds) => format!("about {} left", clock(seconds)),
            None => "time left not yet known".to_owned(),
        };
        let running = self.running.len();
        format!(
            "{} of {} runs done, {running} running, {speed} steps/s, {left}",
            self.ended,
            self.left.len()
        )
    }

    fn work_left(&self) -> f64 {
        self.left.iter().map(|left| left.max(0.0)).sum()
    }

    /// Writes a line above the bars. Errors are ignored: if stderr is gone, nobody reads it.
    pub fn say(&self, line: &str) {
        let line = escape::terminal(line);
        match self.style {
            Style::Bars => drop(self.screen.println(line)),
            Style::Lines => drop(writeln!(io::stderr(), "{line}")),
            Style::Quiet => {}
        }
    }

    /// Writes a line that is shown in every style.
    pub fn complain(&self, line: &str) {
        match self.style {
            Style::Quiet => drop(writeln!(io::stderr(), "{}", escape::terminal(line))),
            Style::Bars | Style::Lines => self.say(line),
        }
    }

    /// Clears the bars.
    pub fn close(&self) {
        self.whole.finish_and_clear();
        drop(self.screen.clear());
    }
}

fn bar_style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .unwrap_or_else(|error| unreachable!("a template in the source: {error}"))
        .progress_chars("━╸─")
}

/// A duration as `h:mm:ss`.
pub fn clock(seconds: f64) -> String {
    let seconds = seconds.max(0.0).round() as u64;
    format!(
        "{}:{:02}:{:02}",
        seconds / 3600,
        seconds / 60 % 60,
        seconds % 60
    )
}

/// A whole number with commas: `12,345`.
pub fn thousands(number: f64) -> String {
    indicatif::HumanCount(number.max(0.0).round() as u64).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_numbers_read_well() {
        assert_eq!(clock(3_725.4), "1:02:05");
        assert_eq!(clock(-1.0), "0:00:00");
        assert_eq!(thousands(1_234_567.0), "1,234,567");
    }

    #[test]
    fn nothing_is_promised_before_anything_is_known() {
        let mut progress = Progress::new(Style::Quiet, false, vec![10.0, 10.0]);
        progress.begin(0, "a", 0, 100, 10.0);
        assert!(
            progress.status().contains("0 of 2 runs done, 1 running")
                && progress.status().contains("not yet known")
        );
        progress.iteration(0, 50, None);
        assert!(progress.status().contains("left") && !progress.status().contains("not yet known"));
    }

    #[test]
    fn work_is_counted_once_however_often_a_run_begins() {
        // The first has a checkpoint at 40.
        let mut progress = Progress::new(Style::Quiet, false, vec![6.0, 10.0]);
        let left = |progress: &Progress, expected: f64| {
            let left = progress.work_left();
            assert!((left - expected).abs() < 1e-9, "{left}, not {expected}");
        };
        progress.begin(0, "a", 40, 100, 10.0); // resumed
        left(&progress, 16.0);
        progress.iteration(0, 90, None);
        left(&progress, 11.0);
        assert!((progress.work_done - 5.0).abs() < 1e-9);
        progress.leave(0); // died; its last checkpoint was at 60
        progress.begin(0, "a", 60, 100, 10.0);
        left(&progress, 14.0);
        progress.iteration(0, 104, None); // a rollout is whole
        left(&progress, 10.0);
        progress.end(0);
        left(&progress, 10.0);
        progress.begin(1, "b", 0, 0, 10.0); // takes no steps
        left(&progress, 10.0);
        progress.leave(1); // another process works on it
        left(&progress, 10.0);
        progress.end(1); // and has finished it
        left(&progress, 0.0);
        assert!(progress.status().contains("2 of 2 runs done"));
    }
}
