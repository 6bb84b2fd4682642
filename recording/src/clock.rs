//! Times as logs have them: seconds, milliseconds, microseconds or nanoseconds, since the start or since 1970, or a date.
//!
//! Seconds since 1970 in one floating-point number are 0.24 µs apart, so whole seconds and the part of a second are kept
//! separately until the first row's time was taken off.

use crate::names::words;
use crate::statistics::quantile;
use std::ops::Range;

/// Times later than this, in seconds, are since 1970: the least is in 1973, and no machine has run for three years.
const SINCE_1970_S: f64 = 1e8;

/// How many of its unit are one second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UnitsPerSecond(pub(crate) u8);

impl UnitsPerSecond {
    pub(crate) const SECONDS: Self = Self(0);
    pub(crate) const MILLISECONDS: Self = Self(3);
    pub(crate) const MICROSECONDS: Self = Self(6);
    pub(crate) const NANOSECONDS: Self = Self(9);

    /// The unit by which a factor turns a number into seconds.
    pub(crate) fn of_scale(scale: f64) -> Option<Self> {
        [
            (1.0, Self::SECONDS),
            (1e-3, Self::MILLISECONDS),
            (1e-6, Self::MICROSECONDS),
            (1e-9, Self::NANOSECONDS),
        ]
        .into_iter()
        .find_map(|(factor, unit)| (factor == scale).then_some(unit))
    }

    pub(crate) fn name(self) -> &'static str {
        match self.0 {
            0 => "seconds",
            3 => "milliseconds",
            6 => "microseconds",
            _ => "nanoseconds",
        }
    }

    /// The unit that is shorter by a factor, nearly, or longer if that is below one.
    pub(crate) fn shorter_by(self, factor: f64) -> Option<Self> {
        let units = [0, 3, 6, 9].into_iter().map(Self);
        let by = |unit: &Self| 10_f64.powi(i32::from(unit.0) - i32::from(self.0));
        let mut others = units.filter(|unit| *unit != self);
        others.find(|unit| (factor / by(unit) - 1.0).abs() < 0.1)
    }

    /// Seconds of one.
    pub(crate) fn seconds(self) -> f64 {
        1.0 / self.count() as f64
    }

    fn count(self) -> i64 {
        10_i64.pow(u32::from(self.0))
    }
}

/// A time in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Instant {
    whole_s: i64,
    /// From 0 to 1.
    part_s: f64,
    /// The sum, rounded once.
    seconds: f64,
}

impl Instant {
    /// Seconds as one number, which must be finite.
    pub(crate) fn from_s(seconds: f64) -> Self {
        let whole = seconds.floor();
        Self {
            whole_s: whole as i64,
            part_s: seconds - whole,
            seconds,
        }
    }

    /// A number of that unit, if it is finite.
    pub(crate) fn from_number(value: f64, unit: UnitsPerSecond) -> Option<Self> {
        let finite = Some(value).filter(|value| value.is_finite());
        finite.map(|value| Self::from_s(value / unit.count() as f64))
    }

    pub(crate) fn from_integer(value: i64, unit: UnitsPerSecond) -> Self {
        let count = unit.count();
        let (whole_s, rest) = (value.div_euclid(count), value.rem_euclid(count));
        let part_s = rest as f64 / count as f64;
        Self {
            whole_s,
            part_s,
            seconds: value as f64 / count as f64,
        }
    }

    /// A decimal number without an exponent, of that unit.
    pub(crate) fn from_decimal(text: &str, unit: UnitsPerSecond) -> Option<Self> {
        let value: f64 = text.parse().ok().filter(|value: &f64| value.is_finite())?;
        let seconds = value / unit.count() as f64;
        let digits = text.strip_prefix('+').unwrap_or(text);
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        // Negative times and exponents are not since 1970 and need no more than one number.
        if whole.is_empty() || whole.len() > 30 || !is_number(whole) || !is_number(part) {
            return Some(Self::from_s(seconds));
        }
        let point = whole.len().saturating_sub(usize::from(unit.0));
        let zeros = "0".repeat(usize::from(unit.0).saturating_sub(whole.len()));
        let part = format!("0.{zeros}{}{part}", &whole[point..]);
        Some(Self {
            whole_s: match &whole[..point] {
                "" => 0,
                whole => whole.parse().ok()?,
            },
            part_s: part.parse().ok()?,
            seconds,
        })
    }

    /// A date and time of day as ISO 8601 writes them, with `T` or a space between, or with the day and the month first where it is
    /// certain which is which; without an offset it is UTC.
    pub(crate) fn from_date(text: &str) -> Option<Self> {
        let (date, time) = text.split_once(['T', 't', ' '])?;
        let mark = date.chars().find(|c| !c.is_ascii_digit())?;
        let fields: Vec<&str> = date.split(mark).collect();
        let &[first, second, third] = &fields[..] else {
            return None;
        };
        let lengths = [first, second, third].map(str::len);
        let (first, second, third) = (digits(first)?, digits(second)?, digits(third)?);
        let (year, month, day) = match (lengths, mark) {
            ([4, 2, 2], '-') => (first, second, third),
            ([1..=2, 1..=2, 4], '.') => (third, second, first),
            ([1..=2, 1..=2, 4], '/') if first > 12 || first == second => (third, second, first),
            ([1..=2, 1..=2, 4], '/') if second > 12 => (third, first, second),
            _ => return None,
        };
        if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
            return None;
        }
        let (time, offset_s) = split_offset(time)?;
        let (clock, part) = time.split_once(['.', ',']).unwrap_or((time, "0"));
        let mut fields = clock.split(':').map(digits);
        let (hour, minute) = (fields.next()??, fields.next()??);
        let second = fields.next().unwrap_or(Some(0))?;
        if fields.next().is_some() || hour > 24 || minute > 59 || second > 60 {
            return None;
        }
        digits(part.get(..1)?)?;
        let part_s: f64 = format!("0.{part}").parse().ok()?;
        let whole_s =
            days_since_1970(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second
                - offset_s;
        Some(Self {
            whole_s,
            part_s,
            seconds: whole_s as f64 + part_s,
        })
    }

    /// As one number, as near as that comes.
    pub(crate) fn seconds(self) -> f64 {
        self.seconds
    }

    pub(crate) fn is_before(self, other: Self) -> bool {
        (self.whole_s, self.part_s) < (other.whole_s, other.part_s)
    }

    fn since(self, start: Self) -> f64 {
        // Times of damaged files may be any.
        let whole_s = i128::from(self.whole_s) - i128::from(start.whole_s);
        whole_s as f64 + (self.part_s - start.part_s)
    }

    /// Taken for seconds so far, of which they are not.
    fn of_unit(self, unit: UnitsPerSecond) -> Self {
        let count = unit.count();
        Self {
            whole_s: self.whole_s.div_euclid(count),
            part_s: (self.whole_s.rem_euclid(count) as f64 + self.part_s) / count as f64,
            seconds: self.seconds / count as f64,
        }
    }

    /// Nanoseconds, whole ones.
    fn whole_ns(self) -> i128 {
        i128::from(self.whole_s) * 1_000_000_000 + (self.part_s * 1e9).round() as i128
    }
}

fn digits(text: &str) -> Option<i64> {
    let all = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    all.then(|| text.parse().ok()).flatten()
}

/// The time of day without its distance from UTC, and that in seconds.
fn split_offset(time: &str) -> Option<(&str, i64)> {
    if let Some(utc) = time.strip_suffix(['Z', 'z']) {
        return Some((utc, 0));
    }
    let Some(at) = time.rfind(['+', '-']) else {
        return Some((time, 0));
    };
    let (time, offset) = time.split_at(at);
    let sign = if offset.starts_with('-') { -1 } else { 1 };
    let offset = offset[1..].replace(':', "");
    let hours = digits(offset.get(..2)?)?;
    let minutes = offset.get(2..).filter(|rest| !rest.is_empty());
    let minutes = minutes.map_or(Some(0), digits)?;
    Some((time, sign * (hours * 3600 + minutes * 60)))
}

/// Of a date in the Gregorian calendar. Years begin in March here, so that the leap day is a year's last.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // Days from the first of March of the year 0 to 1970.
    365 * year + leap_days + day_of_year - 719_468
}

/// The rows' times in seconds, since the first row where the clock counts from 1970.
pub(crate) struct Clock {
    pub(crate) time_s: Vec<f64>,
    /// Of the first row, where times were since 1970.
    pub(crate) start_unix_ns: Option<i128>,
    /// That the times show, where nothing told it.
    pub(crate) guessed_unit: Option<UnitsPerSecond>,
}

impl Clock {
    /// Of times that were read as seconds, and are unless their unit was not told.
    pub(crate) fn new(mut times: Vec<Instant>, unit_is_told: bool) -> Self {
        let guessed_unit = (!unit_is_told).then(|| guess_unit(&times));
        if let Some(unit) = guessed_unit {
            for time in &mut times {
                *time = time.of_unit(unit);
            }
        }
        let since_1970 = times
            .first()
            .copied()
            .filter(|first| first.seconds > SINCE_1970_S);
        let time_s = match since_1970 {
            Some(start) => times.iter().map(|time| time.since(start)).collect(),
            None => times.iter().map(|time| time.seconds).collect(),
        };
        Self {
            time_s,
            start_unix_ns: since_1970.map(Instant::whole_ns),
            guessed_unit,
        }
    }
}

/// Steps of time that go on, and how many rows have the time of the row before.
fn steps(time_s: &[f64]) -> (Vec<f64>, usize) {
    let steps = || time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let repeated = steps().filter(|step| *step == 0.0).count();
    (steps().filter(|step| *step > 0.0).collect(), repeated)
}

/// Whether most rows have the time of the row before: the clock's step is longer than a row.
fn is_coarse(repeated: usize, rows: usize) -> bool {
    2 * repeated > rows
}

/// Puts rows where they most likely were if the clock's step is longer than a row: samples are even, and the first with a new time
/// came as the clock went on. `rate_hz`: of the rows, where it was told. Tells the clock's step, or none if the clock went on too seldom
/// to show a rate; nothing if times are the rows' own.
pub(crate) fn spread(time_s: &mut [f64], rate_hz: Option<f64>) -> Option<Option<f64>> {
    let (steps, repeated) = steps(time_s);
    if !is_coarse(repeated, time_s.len()) {
        return None;
    }
    // where time goes back another trajectory begins
    let mut parts: Vec<Range<usize>> = Vec::new();
    for row in 0..time_s.len() {
        match parts.last_mut() {
            Some(part) if time_s[row] >= time_s[row - 1] => part.end = row + 1,
            _ => parts.push(row..row + 1),
        }
    }
    // first rows with a new time
    let new_in = |part: &Range<usize>| -> Vec<(usize, f64)> {
        let rows = part.clone().skip(1);
        let new = rows.filter(|row| time_s[*row] > time_s[*row - 1]);
        new.map(|row| (row, time_s[row])).collect()
    };
    let new: Vec<Vec<(usize, f64)>> = parts.iter().map(new_in).collect();
    let row_s = |from: (usize, f64), to: (usize, f64)| (to.1 - from.1) / (to.0 - from.0) as f64;
    let ends = new.iter().filter(|new| new.len() > 1);
    let shown = ends.map(|new| row_s(new[0], new[new.len() - 1]));
    let Some(usual_s) = quantile(shown.collect(), 0.5).or(rate_hz.map(f64::recip)) else {
        return Some(None);
    };
    for (part, new) in parts.into_iter().zip(new) {
        let first = new
            .first()
            .copied()
            .unwrap_or((part.start, time_s[part.start]));
        let last = new.last().copied().unwrap_or(first);
        let mean_s = if last.0 > first.0 {
            row_s(first, last)
        } else {
            usual_s
        };
        let at = |row: usize, from: (usize, f64), row_s: f64| {
            from.1 + (row as f64 - from.0 as f64) * row_s
        };
        // each new time came within a row of where even rows have it, or rows are missing
        let is_even = new
            .iter()
            .all(|(row, time_s)| (at(*row, first, mean_s) - time_s).abs() <= mean_s);
        if is_even {
            part.for_each(|row| time_s[row] = at(row, first, mean_s));
            continue;
        }
        // of a step's end that was not recorded rows are as far apart as in the step beside it
        let (mut from, mut step_s) = (part.start, usual_s);
        for pair in new.windows(2) {
            step_s = row_s(pair[0], pair[1]);
            (from..pair[1].0).for_each(|row| time_s[row] = at(row, pair[0], step_s));
            from = pair[1].0;
        }
        (from..part.end).for_each(|row| time_s[row] = at(row, last, step_s));
    }
    Some(quantile(steps, 0.5))
}

/// The step from row to row and the unit of times that were taken for seconds and are others since 1970, where such steps are no log's.
pub(crate) fn mistaken_for_seconds(times: &[Instant]) -> Option<(f64, UnitsPerSecond)> {
    let first = times.first()?;
    let since_first: Vec<f64> = times.iter().map(|time| time.since(*first)).collect();
    let step_s = quantile(steps(&since_first).0, 0.5)?;
    let unit = guess_unit(times);
    let since_1970 = (1e9..4.2e9).contains(&(first.seconds / unit.count() as f64));
    (unit != UnitsPerSecond::SECONDS && since_1970 && step_s >= LONGEST_STEP_S)
        .then_some((step_s, unit))
}

/// No log of joints has rows that are farther apart.
const LONGEST_STEP_S: f64 = 100.0;

/// The unit of times that nothing tells: by their size and steps if they are since 1970, else by their steps, as
/// controllers log from ten to some thousand times a second.
fn guess_unit(times: &[Instant]) -> UnitsPerSecond {
    const UNITS: [UnitsPerSecond; 4] = [
        UnitsPerSecond::SECONDS,
        UnitsPerSecond::MILLISECONDS,
        UnitsPerSecond::MICROSECONDS,
        UnitsPerSecond::NANOSECONDS,
    ];
    let since_first: Vec<f64> = match times.first() {
        Some(first) => times.iter().map(|time| time.since(*first)).collect(),
        None => Vec::new(),
    };
    let (steps, repeated) = steps(&since_first);
    let mut step = quantile(steps.clone(), 0.5).unwrap_or(0.0);
    // a clock that counts in longer steps than rows: it is rows that come ten times a second at least
    let slowest_s = if is_coarse(repeated, times.len()) {
        step *= steps.len() as f64 / times.len() as f64;
        0.1
    } else {
        1.0
    };
    let first = times.first().map_or(0.0, |first| first.seconds);
    // Nanoseconds since a machine was started look like milliseconds since 1970, but for their steps.
    let since_1970 = UNITS.into_iter().find(|unit| {
        let count = unit.count() as f64;
        (1e9..4.2e9).contains(&(first / count)) && step / count < LONGEST_STEP_S
    });
    since_1970.unwrap_or(match step {
        step if step < slowest_s => UnitsPerSecond::SECONDS,
        step if step < 1e3 => UnitsPerSecond::MILLISECONDS,
        step if step < 1e5 => UnitsPerSecond::MICROSECONDS,
        _ => UnitsPerSecond::NANOSECONDS,
    })
}

/// Whether a column's name says that it holds the time, and in which unit.
pub(crate) fn time_column(name: &str) -> Option<Option<UnitsPerSecond>> {
    let words = words(name);
    let words: Vec<&str> = words.iter().map(|word| &**word).collect();
    let (unit, words) = match words.split_last() {
        Some((last, before)) if !before.is_empty() => match unit_of_time(last) {
            None => (None, &words[..]),
            unit => (unit, before),
        },
        _ => (None, &words[..]),
    };
    if let [unit] = words
        && *unit != "s"
        && let Some(unit) = unit_of_time(unit)
    {
        return Some(Some(unit));
    }
    matches!(
        words,
        ["t" | "time" | "timestamp" | "stamp" | "ts" | "zeit" | "datetime" | "timestamps"]
            | ["time" | "date", "stamp" | "time"]
            | ["unix", "stamp"]
            | ["elapsed", "time"]
            | ["elapsed"]
    )
    .then_some(unit)
    .or_else(|| {
        matches!(words, [whose, "time" | "timestamp"] if CLOCKS.contains(whose)).then_some(unit)
    })
    .or_else(|| time_column(stamp_of(name)?))
}

/// `timestamp` of `OSL:timestamp`, where whose it is stands before a colon.
fn stamp_of(name: &str) -> Option<&str> {
    let (_, stamp) = name.rsplit_once(':')?;
    let is_stamp = words(stamp).iter().any(|word| word == "timestamp");
    is_stamp.then_some(stamp)
}

/// Whose clock a time is of; none of these is said of how long something takes.
const CLOCKS: &[&str] = &[
    "meas",
    "pi",
    "ros",
    "sys",
    "system",
    "host",
    "pc",
    "cpu",
    "mcu",
    "unix",
    "epoch",
    "rel",
    "relative",
    "log",
    "robot",
    "controller",
];

fn unit_of_time(word: &str) -> Option<UnitsPerSecond> {
    Some(match word {
        "s" | "sec" | "secs" | "seconds" => UnitsPerSecond::SECONDS,
        "ms" | "msec" | "millis" | "milliseconds" => UnitsPerSecond::MILLISECONDS,
        "us" | "µs" | "usec" | "micros" | "microseconds" => UnitsPerSecond::MICROSECONDS,
        "ns" | "nsec" | "nsecs" | "nanosec" | "nanos" | "nanoseconds" => {
            UnitsPerSecond::NANOSECONDS
        }
        _ => return None,
    })
}

/// The one of these columns that is the time by its name: the only one, or the only one that tells its unit too. One that says whose
/// clock it is, and one that is called by the unit alone, is where there is no other: that may be a part of a time, as `sec` beside
/// `nanosec` is.
pub(crate) fn only_time_column<'a>(
    names: impl Iterator<Item = &'a str>,
) -> Option<(usize, Option<UnitsPerSecond>)> {
    let mut by_rank: [Vec<(usize, Option<UnitsPerSecond>)>; 3] = Default::default();
    for (column, name) in names.enumerate() {
        let Some(unit) = time_column(name) else {
            continue;
        };
        let words = words(name);
        let says_whose =
            || stamp_of(name).is_some() || words.iter().any(|word| CLOCKS.contains(&&**word));
        let rank = match unit_of_time(&words.concat()) {
            Some(_) => 2,
            None => usize::from(says_whose()),
        };
        by_rank[rank].push((column, unit));
    }
    let times = by_rank.into_iter().find(|times| !times.is_empty())?;
    let mut with_unit = times.iter().filter(|(_, unit)| unit.is_some());
    match (&times[..], with_unit.next(), with_unit.next()) {
        ([time], _, _) | (_, Some(time), None) => Some(*time),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_keeps_every_digit_in_any_unit() {
        let start = Instant::from_decimal("1700000000", UnitsPerSecond::SECONDS).unwrap();
        for (text, unit) in [
            ("1700000000.002000093", UnitsPerSecond::SECONDS),
            ("1700000000002.000093", UnitsPerSecond::MILLISECONDS),
            ("1700000000002000.093", UnitsPerSecond::MICROSECONDS),
            ("1700000000002000093", UnitsPerSecond::NANOSECONDS),
        ] {
            let time = Instant::from_decimal(text, unit).unwrap();
            assert_eq!(time.since(start), 0.002_000_093, "{text}");
        }
        let small = Instant::from_decimal("5", UnitsPerSecond::NANOSECONDS).unwrap();
        assert_eq!((small.part_s, small.seconds), (5e-9, 5e-9));
        for other in ["-0.5", "1e3", "+2.5", ".5"] {
            let time = Instant::from_decimal(other, UnitsPerSecond::SECONDS).unwrap();
            assert_eq!(time.seconds(), other.parse::<f64>().unwrap());
        }
        assert!(Instant::from_decimal("inf", UnitsPerSecond::SECONDS).is_none());
        assert!(Instant::from_decimal("12 s", UnitsPerSecond::SECONDS).is_none());
    }

    #[test]
    fn dates_are_read_with_and_without_their_offset() {
        for text in [
            "2023-11-14T22:13:20.25Z",
            "2023-11-14 22:13:20,25",
            "2023-11-14T23:13:20.250+01:00",
            "2023-11-14T16:43:20.25-0530",
        ] {
            let date = Instant::from_date(text).unwrap();
            assert_eq!((date.whole_s, date.part_s), (1_700_000_000, 0.25), "{text}");
        }
        assert_eq!(
            Instant::from_date("2024-02-29T00:00Z").unwrap().whole_s,
            1_709_164_800
        );
        for text in [
            "13/05/2024 0:53",
            "5/13/2024 0:53:00",
            "13.05.2024 00:53",
            "13.5.2024 00:53:00.000",
        ] {
            let date = Instant::from_date(text).unwrap();
            assert_eq!(date.seconds, 1_715_561_580.0, "{text}");
        }
        for wrong in [
            "2023-13-14T00:00Z",
            "05/06/2024 00:53",
            "13/14/2024 00:53",
            "13-05-2024 00:53",
            "13/05/2024/1 00:53",
            "2023-11-14",
            "2023-11-14T25:61:00Z",
            "2023-11-14T1é:00:00",
        ] {
            assert!(Instant::from_date(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn a_unit_that_nothing_tells_is_told_by_size_and_steps() {
        let clock =
            |times: &[f64]| Clock::new(times.iter().copied().map(Instant::from_s).collect(), false);
        assert_eq!(clock(&[0.0, 0.002]).time_s, [0.0, 0.002]);
        assert_eq!(clock(&[0.0, 2.0, 4.0]).time_s, [0.0, 0.002, 0.004]);
        assert_eq!(clock(&[0.0, 2000.0]).time_s, [0.0, 0.002]);
        assert_eq!(clock(&[0.0, 2e6]).time_s, [0.0, 0.002]);
        // whole seconds of rows that come a hundred times as often, and whole milliseconds of three rows each
        let stamps = |rows: u32| -> Vec<f64> { (0..300).map(|k| f64::from(k / rows)).collect() };
        assert_eq!(clock(&stamps(100)).time_s[299], 2.0);
        assert_eq!(clock(&stamps(3)).time_s[299], 0.099);
        assert_eq!(clock(&[1.7e12, 1.7e12 + 2.0]).time_s, [0.0, 0.002]);
        assert_eq!(clock(&[1.7e9, 1.7e9 + 5.0]).time_s, [0.0, 5.0]);
        assert_eq!(clock(&[2e12, 2e12 + 2e6]).time_s, [2000.0, 2000.002]);
        assert_eq!(
            clock(&[1.7e18]).start_unix_ns,
            Some(1_700_000_000_000_000_000)
        );
    }

    #[test]
    fn rows_of_one_time_are_even_between_the_clocks_steps() {
        // a clock of minutes; the first row comes 40 s into one
        let true_s = |row: i32| 40.0 + 0.01 * f64::from(row);
        let minutes = |row: i32| 60.0 * (true_s(row) / 60.0).floor();
        let mut time_s: Vec<f64> = (0..20_000).map(minutes).collect();
        assert_eq!(spread(&mut time_s, None), Some(Some(60.0)));
        for (row, time_s) in (0..).zip(&time_s) {
            assert!((time_s - true_s(row)).abs() < 0.011, "{row}: {time_s}");
        }
        // ticks of 16 ms, and rows of 3 ms
        let ticks = |row: i32| 0.016 * (0.003 * f64::from(row) / 0.016).floor();
        let mut time_s: Vec<f64> = (0..1000).map(ticks).collect();
        spread(&mut time_s, None).unwrap();
        let mut steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(steps.all(|step_s| (step_s - 0.003).abs() < 1e-5));
        // half of the rows of one step are missing
        let there = (0..20_000).filter(|row| !(4000..7000).contains(row));
        let mut time_s: Vec<f64> = there.map(minutes).collect();
        spread(&mut time_s, None).unwrap();
        assert!(time_s.windows(2).all(|pair| pair[1] > pair[0]));
        assert!((time_s[16_999] - true_s(19_999)).abs() < 3.0);
        // too few steps to show a rate, unless it was told
        let mut few: Vec<f64> = (0..5000).map(minutes).collect();
        assert_eq!(spread(&mut few.clone(), None), Some(None));
        spread(&mut few, Some(100.0)).unwrap();
        assert!((few[4999] - few[0] - 49.99).abs() < 1e-9);
        // rows that have times of their own, some of them twice
        let mut own: Vec<f64> = (0..100).map(|k| f64::from(k / 2)).collect();
        let before = own.clone();
        assert_eq!(spread(&mut own, None), None);
        assert_eq!(own, before);
        assert_eq!(spread(&mut [], None), None);
    }

    #[test]
    fn names_of_time_columns_tell_their_unit() {
        for (name, unit) in [
            ("t", None),
            ("Timestamp", None),
            ("time_ms", Some(UnitsPerSecond::MILLISECONDS)),
            ("Time [µs]", Some(UnitsPerSecond::MICROSECONDS)),
            ("time (s)", Some(UnitsPerSecond::SECONDS)),
            ("stamp_ns", Some(UnitsPerSecond::NANOSECONDS)),
            ("milliseconds", Some(UnitsPerSecond::MILLISECONDS)),
            ("ElapsedMilliseconds", Some(UnitsPerSecond::MILLISECONDS)),
            ("DateTime", None),
            ("pi_time", None),
            ("meas_time", None),
            ("OSL:timestamp", None),
            ("knee[A]:timestamp_ms", Some(UnitsPerSecond::MILLISECONDS)),
            ("rosTimestamp_ns", Some(UnitsPerSecond::NANOSECONDS)),
        ] {
            assert_eq!(time_column(name), Some(unit), "{name}");
        }
        let only =
            |names: &[&str]| only_time_column(names.iter().copied()).map(|(column, _)| column);
        assert_eq!(only(&["q", "TS", "t_us"]), Some(2));
        assert_eq!(only(&["q", "TS"]), Some(1));
        assert_eq!(only(&["t_ms", "t_us"]), None);
        assert_eq!(only(&["t", "stamp"]), None);
        assert_eq!(only(&["ms", "q"]), Some(0));
        // a part of a second beside the time, and times in two parts
        assert_eq!(only(&["ms", "t"]), Some(1));
        assert_eq!(only(&["sec", "nanosec"]), None);
        assert_eq!(only(&["ros_time", "q", "time"]), Some(2));
        assert_eq!(only(&["ros_time", "pi_time"]), None);
        assert_eq!(only(&["OSL:timestamp", "start_time", "q"]), Some(0));
        assert_eq!(only(&["OSL:timestamp", "timestamp"]), Some(1));
        for other in [
            "s",
            "torque",
            "time_constant",
            "loop_time",
            "knee:rise_time",
            "loop:time",
            "q",
            "",
        ] {
            assert_eq!(time_column(other), None, "{other}");
        }
    }
}
