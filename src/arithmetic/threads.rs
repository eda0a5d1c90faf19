//! Threads that share the work of one run.
//!
//! The number of threads belongs to the process and not to what is computed: whoever shares work
//! cuts it into the same pieces, and adds in the same order, for any number of them. A test trains
//! with several and compares bits.

use std::{
    sync::{
        Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

static COUNT: AtomicUsize = AtomicUsize::new(1);

/// Lets everything that this process computes from now on share `count` threads, at least one.
pub fn set(count: usize) {
    COUNT.store(count.max(1), Ordering::Relaxed);
}

/// The number of threads that may share a piece of work; 1 until [`set`] says otherwise.
pub fn count() -> usize {
    COUNT.load(Ordering::Relaxed)
}

/// Does `work` on each of `items`, dealt to as many threads as there are `rooms`, one room each. A
/// single room's items come one after the other on this thread, and nothing is allocated. (Starting
/// a thread takes some 20 microseconds: what is shared should take a millisecond.)
pub fn share<R: Send, I: Send>(
    rooms: &mut [R],
    items: impl Iterator<Item = I>,
    work: impl Fn(&mut R, I) + Sync,
) {
    let [own, others @ ..] = rooms else { return };
    if others.is_empty() {
        items.for_each(|item| work(own, item));
        return;
    }
    let mut hands: Vec<Vec<I>> = (0..=others.len()).map(|_| Vec::new()).collect();
    for (number, item) in items.enumerate() {
        hands[number % (others.len() + 1)].push(item);
    }
    let work = &work;
    thread::scope(|scope| {
        for (room, hand) in others.iter_mut().zip(hands.split_off(1)) {
            scope.spawn(move || hand.into_iter().for_each(|item| work(room, item)));
        }
        hands.into_iter().flatten().for_each(|item| work(own, item));
    });
}

/// A value that threads change one after the other, in the order of their numbers, whichever is
/// ready first.
pub struct InOrder<T> {
    state: Mutex<State<T>>,
    moved: Condvar,
}

struct State<T> {
    next: usize,
    value: T,
}

impl<T> InOrder<T> {
    /// `value`, which number 0 changes first.
    pub fn new(value: T) -> Self {
        Self {
            state: Mutex::new(State { next: 0, value }),
            moved: Condvar::new(),
        }
    }

    /// Makes the contribution of number `number`, waits for its turn, and adds it; returns the
    /// rest.
    /// Panics if another thread panicked before its turn.
    pub fn in_turn<M, L>(
        &self,
        number: usize,
        make: impl FnOnce() -> M,
        add: impl FnOnce(&mut T, M) -> L,
    ) -> L {
        let alarm = Alarm(self);
        let made = make();
        let mut state = self.lock();
        while state.next < number {
            state = self
                .moved
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        assert!(state.next == number, "another thread failed");
        let left = add(&mut state.value, made);
        state.next += 1;
        drop(state);
        self.moved.notify_all();
        drop(alarm);
        left
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Wakes the threads that wait for one that panicked, so that they do not wait forever.
struct Alarm<'a, T>(&'a InOrder<T>);

impl<T> Drop for Alarm<'_, T> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.lock().next = usize::MAX;
            self.0.moved.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic]
    fn a_panic_in_one_thread_ends_the_others_that_wait_for_it() {
        let sum = InOrder::new(0);
        share(&mut [(); 3], 0..9, |(), number| {
            sum.in_turn(
                number,
                || assert!(number != 1, "number 1 has nothing to add"),
                |sum, ()| *sum += 1,
            );
        });
    }

    #[test]
    fn each_item_is_done_once_and_added_in_its_place() {
        for threads in 1..=5 {
            let order = InOrder::new(Vec::new());
            let mut rooms = vec![0; threads];
            share(&mut rooms, 0..17, |done, number| {
                *done += 1;
                // The later ones are ready first.
                let wait =
                    || thread::sleep(std::time::Duration::from_micros(100 * (17 - number as u64)));
                order.in_turn(number, wait, |order, ()| order.push(number));
            });
            assert_eq!(rooms.iter().sum::<usize>(), 17);
            assert!(rooms.iter().all(|&done| done >= 17 / threads));
            assert_eq!(order.lock().value, (0..17).collect::<Vec<_>>());
        }
    }
}
