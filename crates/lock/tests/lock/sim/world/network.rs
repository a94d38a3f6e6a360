//! Connections of the simulated cluster: delays, losses, duplicates, and messages that are sent again.

use std::collections::VecDeque;

use rand::RngExt;
use steradian_lock::messages::{ToDirector, ToNode};

use super::{Event, World};
use crate::sim::setup::{OnLoss, SECOND};

/// A connection: director, node, and whether messages go to the node.
pub type Route = (usize, usize, bool);

#[derive(Clone, Debug)]
pub enum Message {
    ToNode(ToNode),
    ToDirector(ToDirector),
}

/// One message of a connection that sends lost messages again.
#[derive(Debug)]
struct InFlight {
    number: u64,
    message: Message,
    has_arrived: bool,
    sent_ns: u64,
    attempt: u32,
}

/// A connection that keeps the order, like TCP: a lost message is sent again when a later one has arrived (selective acknowledgement), or after a
/// time-out that doubles. Later messages wait for it.
#[derive(Debug, Default)]
pub struct Connection {
    /// Changes when either process starts again.
    life: u64,
    next: u64,
    in_flight: VecDeque<InFlight>,
}

impl World {
    /// Drops the messages on their way to or from a process that has ended.
    pub(super) fn reset_connections(&mut self, is_meant: impl Fn(&Route) -> bool) {
        for (_, connection) in self.connections.iter_mut().filter(|(route, _)| is_meant(route)) {
            connection.life += 1;
            connection.in_flight.clear();
        }
    }

    fn send(&mut self, route: Route, sent_ns: u64, message: Message) {
        let is_cut = self.cut.contains(&(route.0, route.1));
        if let (OnLoss::Again { .. }, false) = (self.setup.network.on_loss, is_cut) {
            let connection = self.connections.entry(route).or_default();
            let number = connection.next;
            connection.next += 1;
            connection.in_flight.push_back(InFlight { number, message, has_arrived: false, sent_ns, attempt: 0 });
            self.transmit(route, number, sent_ns);
            return;
        }
        for at_ns in self.arrivals(route, sent_ns) {
            self.push(at_ns, Event::Delivered { route, message: message.clone() });
        }
    }

    /// Sends a message of a connection, for the first time or again.
    fn transmit(&mut self, route: Route, number: u64, sent_ns: u64) {
        let (network, random) = (&self.setup.network, &mut self.random);
        let OnLoss::Again { timeout_ns } = network.on_loss else { return };
        let (is_lost, delay_ns) = (random.random_bool(network.loss), network.delay.draw_ns(random));
        let Some(connection) = self.connections.get_mut(&route) else { return };
        let life = connection.life;
        let Some(sent) = connection.in_flight.iter_mut().find(|sent| sent.number == number) else { return };
        sent.sent_ns = sent_ns;
        sent.attempt += 1;
        let attempt = sent.attempt;
        if is_lost {
            let waits_ns = timeout_ns << (attempt - 1).min(6);
            self.push(sent_ns + waits_ns, Event::TimedOut { connection: route, life, number, attempt });
        } else {
            self.push(sent_ns + delay_ns, Event::Arrived { connection: route, life, number, sent_ns });
        }
    }

    pub(super) fn timed_out(&mut self, route: Route, life: u64, number: u64, attempt: u32) {
        let Some(connection) = self.connections.get(&route).filter(|known| known.life == life) else { return };
        let waiting = connection.in_flight.iter().find(|sent| sent.number == number && !sent.has_arrived);
        if waiting.is_some_and(|sent| sent.attempt == attempt) {
            self.transmit(route, number, self.now_ns);
        }
    }

    pub(super) fn arrived(&mut self, route: Route, life: u64, number: u64, sent_ns: u64) {
        let Some(connection) = self.connections.get_mut(&route).filter(|known| known.life == life) else { return };
        let Some(index) = connection.in_flight.iter().position(|sent| sent.number == number) else { return };
        connection.in_flight[index].has_arrived = true;
        let missing = connection.in_flight.iter().take(index);
        let missing = missing.filter(|sent| !sent.has_arrived && sent.sent_ns < sent_ns).map(|sent| sent.number);
        let missing: Vec<u64> = missing.collect();
        let mut complete = Vec::new();
        while let Some(sent) = connection.in_flight.pop_front_if(|sent| sent.has_arrived) {
            complete.push(sent.message);
        }
        for number in missing {
            let acknowledged_ns = self.now_ns + self.setup.network.delay.draw_ns(&mut self.random);
            self.transmit(route, number, acknowledged_ns);
        }
        for message in complete {
            self.deliver(route, message);
        }
    }

    /// Times at which copies of a message arrive.
    fn arrivals(&mut self, route: Route, sent_ns: u64) -> Vec<u64> {
        let network = &self.setup.network;
        let random = &mut self.random;
        let mut sent_ns = sent_ns;
        if self.cut.contains(&(route.0, route.1)) {
            if !random.random_bool(network.kept_by_cut) {
                return Vec::new();
            }
            sent_ns += random.random_range(0..5 * SECOND);
        }
        let copies = if random.random_bool(network.duplicates) { 2 } else { 1 };
        let mut arrivals = Vec::new();
        for _ in 0..copies {
            if random.random_bool(network.loss) {
                continue;
            }
            let mut at_ns = sent_ns + network.delay.draw_ns(random);
            if network.in_order {
                let last = self.arrives_ns.entry(route).or_insert(0);
                at_ns = at_ns.max(*last);
                *last = at_ns;
            }
            arrivals.push(at_ns);
        }
        arrivals
    }

    pub(super) fn send_to_node(&mut self, director: usize, node: usize, after_ns: u64, message: &ToNode) {
        self.send((director, node, true), self.now_ns + after_ns, Message::ToNode(message.clone()));
    }

    pub(super) fn send_to_director(&mut self, director: usize, node: usize, message: ToDirector) {
        self.send((director, node, false), self.now_ns, Message::ToDirector(message));
    }
}
