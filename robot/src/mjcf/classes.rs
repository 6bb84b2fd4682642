//! Default classes: what elements say that leave it to their class.

use std::collections::BTreeMap;

use crate::error::RobotError;
use crate::xml::Element;

/// Elements of `<actuator>` share one set of defaults, whatever their shortcut.
const ACTUATORS: [&str; 9] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
];

/// The outermost class where it has no name.
const MAIN: &str = "main";

/// The classes of a model.
pub struct Classes<'a> {
    classes: BTreeMap<&'a str, Class<'a>>,
}

#[derive(Default)]
struct Class<'a> {
    parent: Option<&'a str>,
    elements: Vec<&'a Element>,
}

impl<'a> Classes<'a> {
    pub fn of(root: &'a Element) -> Result<Self, RobotError> {
        let mut classes: BTreeMap<&str, Class> = BTreeMap::new();
        classes.insert(MAIN, Class::default());
        let outermost = root.all("default").map(|default| (default, None));
        let mut open: Vec<(&Element, Option<&str>)> = outermost.rev().collect();
        while let Some((default, parent)) = open.pop() {
            let name = match (default.attribute("class"), parent) {
                (Some(name), Some(_)) => name,
                // whatever the outermost is called, elements without class follow it
                (_, None) => MAIN,
                (None, Some(_)) => return Err(default.invalid("class is missing, add it")),
            };
            let class = classes.entry(name).or_default();
            class.parent = parent;
            let (inner, own): (Vec<_>, Vec<_>) = default
                .children()
                .partition(|child| child.tag() == "default");
            class.elements.extend(own);
            open.extend(inner.into_iter().rev().map(|child| (child, Some(name))));
            if let (Some(alias), None) = (default.attribute("class"), parent)
                && alias != MAIN
            {
                classes.entry(alias).or_default().parent = Some(MAIN);
            }
        }
        Ok(Self { classes })
    }

    /// The element with what its class says; `around` is the class of what it is in.
    pub fn view(
        &self,
        element: &'a Element,
        around: Option<&'a str>,
    ) -> Result<View<'a>, RobotError> {
        let named = element.attribute("class").or(around);
        if let Some(name) = named.filter(|name| !self.classes.contains_key(name)) {
            let known: Vec<String> = self.classes.keys().map(|name| (*name).to_owned()).collect();
            return Err(element.place().unknown("class", name, &known));
        }
        let mut defaults = Vec::new();
        let mut next = Some(named.unwrap_or(MAIN));
        while let Some(class) = next.and_then(|name| self.classes.get(name)) {
            // what is said later counts
            let own = class.elements.iter().rev();
            defaults.extend(own.clone().filter(|own| own.tag() == element.tag()));
            if ACTUATORS.contains(&element.tag()) {
                let other =
                    |own: &&&Element| own.tag() != element.tag() && ACTUATORS.contains(&own.tag());
                defaults.extend(own.filter(other));
            }
            next = class.parent;
        }
        Ok(View { element, defaults })
    }
}

/// An element with what its class says.
pub struct View<'a> {
    pub element: &'a Element,
    /// Nearest first.
    defaults: Vec<&'a Element>,
}

impl<'a> View<'a> {
    /// An element that has no class.
    pub fn of(element: &'a Element) -> Self {
        Self {
            element,
            defaults: Vec::new(),
        }
    }

    /// The element that says it.
    fn holder(&self, key: &str) -> Option<&'a Element> {
        let all = std::iter::once(self.element).chain(self.defaults.iter().copied());
        all.into_iter()
            .find(|element| element.attribute(key).is_some())
    }

    pub fn attribute(&self, key: &str) -> Option<&'a str> {
        self.holder(key)?.attribute(key)
    }

    pub fn list(&self, key: &str) -> Result<Option<Vec<f64>>, RobotError> {
        self.holder(key).map_or(Ok(None), |holder| holder.list(key))
    }

    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, RobotError> {
        self.holder(key)
            .map_or(Ok(None), |holder| holder.numbers(key))
    }

    /// The first of one or more numbers.
    pub fn number(&self, key: &str) -> Result<Option<f64>, RobotError> {
        Ok(self.list(key)?.and_then(|values| values.first().copied()))
    }

    /// A range that counts: where it is not switched off.
    pub fn range(
        &self,
        key: &str,
        switch: &str,
        autolimits: bool,
    ) -> Result<Option<[f64; 2]>, RobotError> {
        let counts = match self.attribute(switch) {
            Some("true") => true,
            Some("false") => false,
            _ => autolimits,
        };
        Ok(self
            .numbers(key)?
            .filter(|[low, high]: &[f64; 2]| counts && low < high))
    }
}
