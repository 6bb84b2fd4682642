//! Friction over velocity: Tables I and II, Fig. 4 for every joint.

use identification::friction::{
    DirectionFit, FrictionModel, JointFriction, ModelComparison, SteadyMeasurement,
};
use report::{
    Axis, Cell, Column, Figure, Panel, Section, Series, Table, number, printed, with_error,
};
use robot::StribeckRow;
use robot::published::{FrictionModelScores, ModelScore, Published};

use super::{DIRECTIONS, JointResult, SIGNS, without};

/// Points of a drawn curve.
const CURVE_POINTS: u32 = 200;

pub fn section(joints: &[JointResult], paper: Option<&Published>) -> Section {
    let section = Section::new("friction", "Friction over velocity");
    let section = without(
        section,
        joints,
        |j| j.friction.is_some(),
        "Friction over velocity",
        "friction",
    );
    let frictions: Vec<&JointFriction> =
        joints.iter().filter_map(|j| j.friction.as_ref()).collect();
    if frictions.is_empty() {
        return section;
    }
    let section = section
        .paragraph(
            "Each joint moved at constant velocities in both directions, in velocity mode. A measurement is the mean of \
             motor torque times gear ratio less gravity over whole motor revolutions. Each direction is fitted on its own \
             by weighted least squares.",
        )
        .table(table_i(&frictions, paper))
        .definitions([
            ("variance", "Weighted residual variance, eq (6): squared misses of the mean friction at each speed, in variances of one measurement at that speed, summed over the speeds; mean of both directions. The better trials repeat, the more the same miss counts."),
            ("MSE per DOF", "1 + variance / (speeds − coefficients): one where the model is right."),
            ("BIC", "Information criterion of Schwarz over both directions; the lowest is chosen. Only differences mean something."),
            ("held-out rms", "Each trial predicted by a fit to the others."),
        ])
        .table(table_ii(&frictions, paper));
    frictions.iter().fold(section, |section, friction| {
        let section = section.heading(&friction.joint).paragraph(&friction.reason);
        section.figure(figure(friction, paper))
    })
}

fn table_i(frictions: &[&JointFriction], paper: Option<&Published>) -> Table {
    let mut table = Table::new(
        "Three models of friction (PA10-05, Table I)",
        [
            Column::text("joint"),
            Column::text("model"),
            Column::number("model DOF"),
            Column::number("variance"),
            Column::number("published"),
            Column::number("MSE per DOF"),
            Column::number("published"),
            Column::number("BIC"),
            Column::number("held-out rms, Nm"),
        ],
    );
    for friction in frictions {
        let scores = paper
            .and_then(|paper| paper.joint(&friction.joint))
            .map(|joint| joint.table_i);
        for (row, fit) in friction.models.iter().enumerate() {
            let score = scores.map(|scores| score(&scores, fit.model));
            let published = |pick: fn(ModelScore) -> f64| {
                Cell::published(score.map_or(String::new(), |score| printed(pick(score))))
            };
            let name = fit.model.name();
            let joint = if row == 0 {
                friction.joint.as_str()
            } else {
                ""
            };
            table.row([
                joint.into(),
                if fit.model == friction.chosen {
                    Cell::strong(name)
                } else {
                    name.into()
                },
                fit.model.parameter_count().to_string().into(),
                number(fit.weighted_residual_variance, 4).into(),
                published(|score| score.residual_variance),
                optional(fit.mse_per_dof, 4),
                published(|score| score.mse_per_dof),
                number(fit.bic, 4).into(),
                optional(fit.held_out_rms_nm, 2),
            ]);
        }
    }
    table.note("Bold: chosen. A robot file takes Stribeck where cubic is chosen, because a cubic runs away beyond the measured speeds.");
    table
}

fn score(scores: &FrictionModelScores, model: FrictionModel) -> ModelScore {
    match model {
        FrictionModel::CoulombViscous => scores.viscous,
        FrictionModel::Cubic => scores.cubic,
        FrictionModel::Stribeck => scores.stribeck,
    }
}

fn table_ii(frictions: &[&JointFriction], paper: Option<&Published>) -> Table {
    let symbols = FrictionModel::Stribeck.symbols();
    let mut columns = vec![Column::text("joint"), Column::text("")];
    columns.extend(
        symbols
            .iter()
            .map(|(symbol, unit)| Column::number(format!("{symbol}, {unit}"))),
    );
    let mut table = Table::new(
        "Friction coefficients ± standard error (PA10-05, Table II)",
        columns,
    );
    for friction in frictions {
        let Some(model) = friction.model(friction.robot_model()) else {
            continue;
        };
        let published = published_rows(paper, &friction.joint);
        for (index, fit) in directions(model).into_iter().enumerate() {
            let joint = if index == 0 {
                friction.joint.as_str()
            } else {
                ""
            };
            let mut row: Vec<Cell> = vec![joint.into(), SIGNS[index].into()];
            row.extend(symbols.iter().map(|(symbol, _)| coefficient(fit, symbol)));
            table.row(row);
            if let Some(rows) = published {
                let mut row: Vec<Cell> = vec!["".into(), Cell::published("published")];
                row.extend(values(&rows[index]).map(|value| Cell::published(printed(value))));
                table.row(row);
            }
        }
    }
    table.note(
        "Eq (7): F0 + Fv·v + Fs·(1 − exp(−v/Vc)), both directions as magnitudes that oppose the motion. * on the bound of \
         what the speeds can tell: a finding, not a value.",
    );
    table
}

fn coefficient(fit: &DirectionFit, symbol: &str) -> Cell {
    let text = fit.parameter(symbol).map(|parameter| {
        let bound = if parameter.at_bound { " *" } else { "" };
        match parameter.standard_error {
            Some(error) => with_error(parameter.value, error) + bound,
            None => number(parameter.value, 4) + bound,
        }
    });
    text.unwrap_or_else(|| "-".to_owned()).into()
}

fn values(row: &StribeckRow) -> [f64; 4] {
    [row.f0_nm, row.fv_nm_s_rad, row.fs_nm, row.vc_rad_s]
}

fn published_rows(paper: Option<&Published>, joint: &str) -> Option<[StribeckRow; 2]> {
    let table = paper?.joint(joint)?.table_ii;
    Some([table.positive, table.negative])
}

fn directions(model: &ModelComparison) -> [&DirectionFit; 2] {
    [&model.positive, &model.negative]
}

fn optional(value: Option<f64>, digits: usize) -> Cell {
    value
        .map_or("-".to_owned(), |value| number(value, digits))
        .into()
}

/// The trials at one speed.
struct Level {
    speed_rad_s: f64,
    mean_nm: f64,
    /// Standard deviation over the trials.
    scatter_nm: f64,
}

/// Mean and scatter at each speed of a direction, slowest first.
fn levels(friction: &JointFriction, sign: f64) -> Vec<Level> {
    let mut trials: Vec<&SteadyMeasurement> = friction
        .measurements
        .iter()
        .filter(|measurement| measurement.direction().sign() == sign)
        .collect();
    trials.sort_by(|a, b| a.speed_rad_s().total_cmp(&b.speed_rad_s()));
    // Trials of one speed agree to a percent, neighbouring speeds of the protocol do not.
    let same = |a: &&SteadyMeasurement, b: &&SteadyMeasurement| {
        (a.reference_rad_s - b.reference_rad_s).abs() < 1e-3 * a.reference_rad_s.abs()
    };
    trials.chunk_by(same).map(level).collect()
}

fn level(trials: &[&SteadyMeasurement]) -> Level {
    let count = trials.len() as f64;
    let mean =
        |value: fn(&SteadyMeasurement) -> f64| trials.iter().map(|m| value(m)).sum::<f64>() / count;
    let mean_nm = mean(SteadyMeasurement::level_nm);
    let squares: f64 = trials
        .iter()
        .map(|m| (m.level_nm() - mean_nm).powi(2))
        .sum();
    Level {
        speed_rad_s: mean(SteadyMeasurement::speed_rad_s),
        mean_nm,
        scatter_nm: (squares / (count - 1.0).max(1.0)).sqrt(),
    }
}

fn figure(friction: &JointFriction, paper: Option<&Published>) -> Figure {
    let both = [levels(friction, 1.0), levels(friction, -1.0)];
    let mut figure = Figure::new(format!(
        "Friction of {} over velocity (PA10-05, Fig. 4; PA10-03, Fig. 4). Above: mean of the trials at each speed, error \
         bars one standard deviation between trials, and the three fits. Below: measured less fitted.",
        friction.joint
    ))
    .columns(2)
    .panel_height(280);
    let published = published_rows(paper, &friction.joint);
    for (index, levels) in both.iter().enumerate() {
        figure = figure.panel(curves(
            friction,
            levels,
            index,
            published.map(|rows| rows[index]),
        ));
    }
    for (index, levels) in both.iter().enumerate() {
        figure = figure.panel(misses(friction, levels, index));
    }
    figure
}

fn curves(
    friction: &JointFriction,
    levels: &[Level],
    index: usize,
    published: Option<StribeckRow>,
) -> Panel {
    let fastest_rad_s = fastest_rad_s(levels);
    let curve = |law: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
        (0..=CURVE_POINTS)
            .map(|i| f64::from(i) / f64::from(CURVE_POINTS) * fastest_rad_s)
            .map(|speed_rad_s| [speed_rad_s, law(speed_rad_s)])
            .collect()
    };
    let measured = levels
        .iter()
        .map(|level| [level.speed_rad_s, level.mean_nm]);
    let mut panel = Panel::new(speed_axis(levels), Axis::new("friction", "Nm"))
        .title(DIRECTIONS[index])
        .series(Series::points("measured", measured).with_errors(scatters_nm(levels)));
    for model in &friction.models {
        let fit = directions(model)[index];
        let law = |speed_rad_s| fit.level_nm(speed_rad_s);
        panel = panel.series(Series::line(model.model.name(), curve(&law)));
    }
    if let Some(row) = published {
        let [f0, fv, fs, vc] = values(&row);
        let law = |v: f64| f0 + fv * v + fs * (1.0 - (-v / vc).exp());
        panel = panel.series(Series::dashed("published Stribeck curve", curve(&law)));
    }
    panel
}

fn misses(friction: &JointFriction, levels: &[Level], index: usize) -> Panel {
    let mut panel =
        Panel::new(speed_axis(levels), Axis::new("measured − fitted", "Nm")).horizontal(0.0, "");
    for model in &friction.models {
        let fit = directions(model)[index];
        let missed = levels.iter().map(|level| {
            let fitted_nm = fit.level_nm(level.speed_rad_s);
            [level.speed_rad_s, level.mean_nm - fitted_nm]
        });
        let series = Series::points(model.model.name(), missed);
        panel = panel.series(series.with_errors(scatters_nm(levels)));
    }
    panel
}

fn fastest_rad_s(levels: &[Level]) -> f64 {
    let speeds = levels.iter().map(|level| level.speed_rad_s);
    speeds.fold(0.0, f64::max)
}

/// The same above and below: from rest to a little beyond the fastest.
fn speed_axis(levels: &[Level]) -> Axis {
    Axis::new("speed", "rad/s").range(0.0, 1.04 * fastest_rad_s(levels))
}

fn scatters_nm(levels: &[Level]) -> impl Iterator<Item = f64> + '_ {
    levels.iter().map(|level| level.scatter_nm)
}
