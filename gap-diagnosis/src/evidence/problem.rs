//! What is asked of the evidence: what is to be explained, what may be named, and what is in every set.

use std::ops::Range;

use gap_report::Remains;
use nalgebra::{DMatrix, DVector};

use super::Names;

/// Names without which another is less to be expected.
#[derive(Clone, Copy, Debug)]
pub struct Presupposed {
    /// Their items.
    pub names: Names,
    /// What each costs where it is missing, in nats.
    pub nats: f64,
}

impl Presupposed {
    /// No name.
    pub const NOTHING: Self = Self {
        names: 0,
        nats: 0.0,
    };
}

/// Something that may be named.
#[derive(Clone, Copy, Debug)]
pub struct Item<'a> {
    /// Items of one kind are one name with other shapes: a set holds one of them at most.
    pub kind: usize,
    /// What naming it costs, in nats.
    pub cost: f64,
    /// Without which it costs more.
    pub presupposed: Presupposed,
    /// Standard deviation of its amplitudes, where something is known of them before anything is seen.
    pub deviation: Option<f64>,
    /// Whether every joint may have it.
    pub is_usual: bool,
    /// A column for each amplitude.
    pub columns: &'a [Vec<f64>],
}

/// A smooth law on no list.
#[derive(Clone, Debug)]
pub struct Smooth {
    /// What it is a law over.
    pub over: Remains,
    /// Part of what names explain by which what it stands for is never exact: less than that is no rest.
    pub inexact: f64,
    /// What saying that there is one costs, in nats.
    pub cost: f64,
    /// It is a sum of these.
    pub columns: Vec<Vec<f64>>,
}

/// Rows of one compared signal, and what they hold whatever the model.
#[derive(Clone, Debug)]
pub struct Span {
    /// Where they are.
    pub rows: Range<usize>,
    /// Root mean square of what nobody can tell of them.
    pub floor_nm: f64,
}

/// What a shared cause's other joints say of its amplitudes: precision, and precision times mean, in the columns' own units.
#[derive(Clone, Debug)]
pub struct Message {
    /// Of all amplitudes.
    pub precision: DMatrix<f64>,
    /// Times their mean.
    pub pull: DVector<f64>,
}

/// Everything that is regressed: laws, and beside them columns that are in every set.
pub struct Problem<'a> {
    /// What is to be explained.
    pub gap_nm: &'a [f64],
    /// Signals, one after the other, together all rows.
    pub spans: &'a [Span],
    /// What may be named.
    pub items: &'a [Item<'a>],
    /// Columns with a standard deviation of one.
    pub tolerated: &'a [Vec<f64>],
    /// Whether a part that is left out may tell their values too, at the price of what the others say of them: of responses that are
    /// the model's own. Along a recorded motion they stand for other choices of a motion's columns, which the other parts decide.
    pub is_open: bool,
    /// Part of what the names explain by which no law is exact.
    pub inexact: f64,
    /// A shared cause's columns, with what the other joints say of them.
    pub shared: Option<(&'a [Vec<f64>], &'a Message)>,
}
