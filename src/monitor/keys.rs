//! What keys do: a stop asks nothing, a reset asks once.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use shm_types::messages::OperatorOrder;

/// What is to be done after a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Leave; the robot goes on.
    Leave,
    /// Count times anew.
    Clear,
    /// Pass an order on.
    Order(OperatorOrder),
}

/// Whether a reset waits to be confirmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keys {
    /// `r` was pressed, and nothing since.
    pub reset_asked: bool,
}

impl Keys {
    /// Takes a key.
    pub fn press(&mut self, key: KeyEvent) -> Option<Action> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let was_asked = std::mem::take(&mut self.reset_asked);
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => {
                Some(Action::Leave)
            }
            KeyCode::Char('q') => Some(Action::Leave),
            KeyCode::Char('c') => Some(Action::Clear),
            KeyCode::Char('e') => Some(Action::Order(OperatorOrder::EmergencyStop)),
            KeyCode::Char('r') => {
                self.reset_asked = true;
                None
            }
            KeyCode::Char('y') if was_asked => Some(Action::Order(OperatorOrder::Reset)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(keys: &mut Keys, letter: char) -> Option<Action> {
        keys.press(KeyEvent::new(KeyCode::Char(letter), KeyModifiers::NONE))
    }

    #[test]
    fn a_stop_needs_one_key_and_a_reset_two_in_a_row() {
        let mut keys = Keys::default();
        let stop = Some(Action::Order(OperatorOrder::EmergencyStop));
        let reset = Some(Action::Order(OperatorOrder::Reset));
        assert_eq!(press(&mut keys, 'e'), stop);
        assert_eq!(press(&mut keys, 'y'), None, "nothing was asked");
        assert_eq!(press(&mut keys, 'r'), None);
        assert_eq!(press(&mut keys, 'y'), reset);
        assert_eq!(press(&mut keys, 'y'), None, "confirmed once");
        assert_eq!(press(&mut keys, 'r'), None);
        assert_eq!(press(&mut keys, 'x'), None);
        assert_eq!(press(&mut keys, 'y'), None, "another key takes it back");
        assert_eq!(press(&mut keys, 'r'), None);
        assert_eq!(press(&mut keys, 'e'), stop, "a stop goes first");
    }

    #[test]
    fn leaving_gives_no_order() {
        let mut keys = Keys::default();
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(keys.press(interrupt), Some(Action::Leave));
        assert_eq!(press(&mut keys, 'q'), Some(Action::Leave));
        assert_eq!(press(&mut keys, 'c'), Some(Action::Clear));
    }
}
