//! Faults: kills, hangs, cut connections and clocks that are set.

use super::{DIRECTORS, Event, World};
use crate::sim::setup::{Fault, MS};

impl World {
    pub(super) fn fault(&mut self, fault: Fault) {
        let now_ns = self.now_ns;
        match fault {
            Fault::KillNode(node, downtime_ns) => {
                self.end_node(node);
                self.nodes[node].was_harmed = true;
                for director in 0..DIRECTORS {
                    self.push(now_ns + self.setup.noticed_ns, Event::Lost { director, node });
                }
                self.push(now_ns + downtime_ns, Event::StartNode(node));
            }
            Fault::HangNode(node, hang_ns) => {
                let until_ns = now_ns + hang_ns;
                self.nodes[node].was_harmed = true;
                self.nodes[node].process.hung_until_ns = until_ns;
                self.wake_node_at(node, until_ns);
            }
            Fault::KillDirector(director, downtime_ns) => {
                self.directors[director].machine = None;
                self.directors[director].inbox.clear();
                self.directors[director].process.life += 1;
                if let Some(downtime_ns) = downtime_ns {
                    self.push(now_ns + downtime_ns, Event::StartDirector(director));
                }
            }
            Fault::HangDirector(director, hang_ns) => {
                let until_ns = now_ns + hang_ns;
                self.directors[director].process.hung_until_ns = until_ns;
                self.wake_director_at(director, until_ns);
            }
            Fault::StartDirector(director) => self.start_director(director),
            Fault::Cut(director, nodes) => {
                for node in nodes {
                    self.cut.insert((director, node));
                    self.push(now_ns + self.setup.lease_ns, Event::Lost { director, node });
                }
            }
            Fault::Heal(director, nodes) => {
                for node in nodes {
                    self.cut.remove(&(director, node));
                    self.push(now_ns + 50 * MS, Event::Connected { node });
                }
            }
            Fault::StepNodeClock(node, step_ns) => self.nodes[node].process.tai_error_ns += step_ns,
            Fault::StepDirectorClock(director, step_ns) => {
                self.directors[director].process.tai_error_ns += step_ns;
                self.checker.compares_slots = false;
            }
            Fault::Discipline(node, is_disciplined) => self.nodes[node].process.is_disciplined = is_disciplined,
        }
    }
}
