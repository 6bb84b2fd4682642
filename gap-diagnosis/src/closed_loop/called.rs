//! What the items of a joint's evidence are called: each hypothesis' effect, with the errors of its parameters.

use std::collections::BTreeMap;

use gap_report::Parameter;
use nalgebra::DMatrix;
use robot::Effect;

use super::rows::About;
use crate::closed_loop::search::Search;
use crate::closed_loop::values;
use crate::evidence::told::Called;

/// The items about one model.
pub struct Responses<'a> {
    /// The joint.
    pub search: &'a Search<'a>,
    /// About its model.
    pub about: &'a About,
}

impl Called for Responses<'_> {
    fn items(&self) -> usize {
        self.about.responses.len()
    }

    fn kind(&self, item: usize) -> usize {
        self.about.kind(item)
    }

    fn is_usual(&self, item: usize) -> bool {
        self.about.is_usual(item)
    }

    fn effect(&self, item: usize, amplitudes: &[f64]) -> Effect {
        let term = self.about.term(self.search, item, amplitudes);
        term.effect(&self.search.scale)
    }

    fn parameters(
        &self,
        item: usize,
        amplitudes: &[f64],
        covariance: &DMatrix<f64>,
    ) -> BTreeMap<String, Parameter> {
        let term = self.about.term(self.search, item, amplitudes);
        // whether a switch is there is no value of its effect
        let skipped = usize::from(term.hypothesis.is_switch()).min(covariance.nrows());
        let count = covariance.nrows() - skipped;
        let own = covariance.view((skipped, skipped), (count, count));
        values::term_parameters(self.search, &term, &own.into_owned()).0
    }
}
