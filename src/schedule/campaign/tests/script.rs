//! Jobs that live as a test has written it down.

use std::{
    collections::{HashMap, VecDeque},
    io,
    time::Duration,
};

use crate::schedule::{
    campaign::{Executor, Message},
    event::{Event, Job},
    stop::StopRequest,
};

/// What one life of a job tells; a life without an end hangs.
pub type Life = Vec<Message>;

/// Jobs that tell what a test wrote down, life after life.
#[derive(Default)]
pub struct Script {
    pub lives: HashMap<usize, VecDeque<Life>>,
    pub told: VecDeque<(usize, Message)>,
    pub running: Vec<usize>,
    pub started: Vec<usize>,
    pub threads: Vec<usize>,
    pub most: usize,
    /// How many jobs ran, and how many had been started, whenever the campaign waited.
    pub waits: Vec<(usize, usize)>,
    pub stopped: Vec<usize>,
    pub killed: Vec<usize>,
    /// The campaign stands still for so long when it first waits.
    pub stands_still: Option<Duration>,
    /// Jobs that are asked to stop leave without a word.
    pub abrupt: bool,
    /// Asks for a stop when so many jobs have been started.
    pub stop_at: Option<(usize, StopRequest)>,
}

impl Script {
    fn exit(&mut self, number: usize, event: Option<Event>, how: &str) {
        self.told
            .extend(event.map(|event| (number, Message::Event(event))));
        self.told.push_back((number, exited(how)));
    }
}

impl Executor for Script {
    fn start(&mut self, number: usize, job: &Job) -> io::Result<()> {
        assert!(
            job.stamp.fingerprint.ends_with(&number.to_string()),
            "another run's job"
        );
        self.started.push(number);
        self.threads.push(job.threads);
        self.running.push(number);
        self.most = self.most.max(self.running.len());
        let life = self.lives.get_mut(&number).and_then(VecDeque::pop_front);
        self.told.extend(
            life.unwrap_or_else(|| finishes(5.0))
                .into_iter()
                .map(|message| (number, message)),
        );
        if let Some((_, stop)) = self
            .stop_at
            .as_ref()
            .filter(|(count, _)| *count == self.started.len())
        {
            stop.make();
        }
        Ok(())
    }

    fn wait(&mut self, timeout: Duration) -> Option<(usize, Message)> {
        self.waits.push((self.running.len(), self.started.len()));
        assert!(self.waits.len() < 10_000, "it waits for ever");
        std::thread::sleep(self.stands_still.take().unwrap_or_default());
        let message = self.told.pop_front();
        match &message {
            Some((number, Message::Exited { .. })) => {
                self.running.retain(|running| running != number)
            }
            Some(_) => {}
            None => std::thread::sleep(timeout.min(Duration::from_millis(5))),
        }
        message
    }

    fn stop(&mut self, number: usize) {
        self.stopped.push(number);
        self.told.retain(|(other, _)| *other != number);
        self.exit(
            number,
            (!self.abrupt).then_some(Event::Stopped),
            "exit code 130",
        );
    }

    fn kill(&mut self, number: usize) {
        self.killed.push(number);
        self.exit(number, None, "killed by signal 9 (SIGKILL)");
    }
}

pub fn exited(how: &str) -> Message {
    Message::Exited {
        how: how.to_owned(),
        stderr: vec!["said".to_owned()],
    }
}

pub fn began() -> Message {
    Message::Event(Event::Began { from_env_steps: 0 })
}

pub fn finishes(dense_return: f64) -> Life {
    let evaluation = Event::Evaluation {
        env_steps: 1024,
        dense_return,
        last: true,
    };
    vec![
        began(),
        Message::Event(evaluation),
        Message::Event(Event::Finished),
        exited("exit code 0"),
    ]
}

pub fn crashes() -> Life {
    vec![began(), exited("killed by signal 6 (SIGABRT)")]
}
