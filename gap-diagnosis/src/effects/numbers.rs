//! An effect's parameters as numbers with names, as reports tell them.

use std::collections::BTreeMap;

use robot::Effect;

/// An effect's parameters by name; a point is three of them.
pub fn numbers(effect: &Effect) -> BTreeMap<String, f64> {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(effect) else {
        return BTreeMap::new();
    };
    let mut numbers = BTreeMap::new();
    for (name, value) in fields {
        match value {
            serde_json::Value::Number(number) => {
                numbers.insert(name, number.as_f64().unwrap_or(0.0));
            }
            serde_json::Value::Array(items) => {
                // one number is the distance along z
                numbers.insert(
                    name.clone(),
                    items.last().and_then(|z| z.as_f64()).unwrap_or(0.0),
                );
                for (axis, item) in ["x", "y", "z"].iter().zip(items) {
                    numbers.insert(format!("{name}_{axis}"), item.as_f64().unwrap_or(0.0));
                }
            }
            _ => {}
        }
    }
    numbers
}

pub(crate) fn side(effect: &Effect) -> Option<String> {
    let fields = serde_json::to_value(effect).ok()?;
    fields.get("side")?.as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_three_numbers_and_a_side_is_none() {
        let payload = Effect::Payload {
            mass_kg: 2.0,
            centre_m: [0.1, 0.2, 0.3],
        };
        let found = numbers(&payload);
        assert_eq!(found["mass_kg"], 2.0);
        assert_eq!(found["centre_m_y"], 0.2);
        assert_eq!(side(&payload), None);
    }
}
