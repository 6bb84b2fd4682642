//! `flexspline drives scan`: which slaves are on an interface.

use std::fmt::Write;
use std::path::Path;

use ethercat::client::Client;
use ethercat::master::Device;
use ethercat::setup::{OwnInterface, axes_of, find};
use serde::Serialize;

use crate::cli::ScanArguments;
use crate::error::CliError;
use crate::output::{print, write_json};

/// For programs.
#[derive(Serialize)]
struct Scanned<'a> {
    schema: u32,
    interface: &'a str,
    slaves: Vec<Found>,
}

#[derive(Serialize)]
struct Found {
    position: usize,
    name: String,
    vendor: u32,
    product: u32,
    revision: u32,
    serial_number: u32,
    alias: u16,
    distributed_clock: bool,
    axes: Vec<FoundAxis>,
}

#[derive(Serialize)]
struct FoundAxis {
    /// Modes of operation by number.
    modes: Vec<u8>,
    statusword: u32,
    error_code: u32,
    /// Counts a turn, as 0x608f says.
    encoder_counts: Option<u32>,
    link_encoder_counts: Option<u32>,
    rated_torque_mnm: Option<u32>,
}

/// Looks, and tells.
///
/// # Errors
/// [`CliError::Input`] if there is nothing to see.
pub fn scan(arguments: &ScanArguments) -> Result<(), CliError> {
    let interface = &arguments.interface;
    let cable = OwnInterface::take(interface).map_err(CliError::input)?;
    let (mut client, master) = find(&cable, interface).map_err(CliError::input)?;
    let slaves = master
        .devices
        .iter()
        .enumerate()
        .map(|(position, device)| look(&mut client, position, device))
        .collect::<Result<Vec<Found>, _>>();
    // found in INIT, left in INIT
    let left = client.write_all(0x0120, &[0x11, 0]);
    let slaves = slaves.map_err(CliError::input)?;
    left.map_err(CliError::input)?;
    if let Some(path) = &arguments.json {
        let scanned = Scanned {
            schema: 1,
            interface: &arguments.interface,
            slaves,
        };
        write_json(&scanned, path)?;
        if path == Path::new("-") {
            return Ok(());
        }
        return print(&told(&scanned.slaves));
    }
    print(&told(&slaves))
}

fn look(
    client: &mut Client,
    position: usize,
    device: &Device,
) -> Result<Found, ethercat::client::ClientError> {
    let station = device.station;
    let mut axes = Vec::new();
    for axis in 0..u16::from(axes_of(client, station)?) {
        let mut number = |index: u16, sub_index: u8| {
            let index = index + ethercat::image::AXIS_OFFSET * axis;
            client.number(station, index, sub_index).ok()
        };
        let modes = number(0x6502, 0).unwrap_or(0);
        axes.push(FoundAxis {
            // bit 0 is mode 1
            modes: (0..10)
                .filter(|bit| modes >> bit & 1 != 0)
                .map(|bit| bit + 1)
                .collect(),
            statusword: number(0x6041, 0).unwrap_or(0),
            error_code: number(0x603f, 0).unwrap_or(0),
            encoder_counts: number(0x608f, 1),
            link_encoder_counts: number(0x60e6, 1),
            rated_torque_mnm: number(0x6076, 0),
        });
    }
    let [vendor, product, revision, serial_number] = device.identity;
    Ok(Found {
        position,
        name: device.name.clone(),
        vendor,
        product,
        revision,
        serial_number,
        alias: device.alias,
        distributed_clock: device.has_clock,
        axes,
    })
}

fn told(slaves: &[Found]) -> String {
    let mut text = String::new();
    for slave in slaves {
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "slave {}: {}, vendor {:#010x}, product {:#010x}, revision {}, serial number {}, alias {}, {}",
            slave.position,
            slave.name,
            slave.vendor,
            slave.product,
            slave.revision,
            slave.serial_number,
            slave.alias,
            if slave.distributed_clock {
                "distributed clock"
            } else {
                "no distributed clock"
            }
        );
        for (position, axis) in slave.axes.iter().enumerate() {
            let number = |value: Option<u32>, unit: &str| {
                value.map_or_else(|| "unknown".to_owned(), |value| format!("{value} {unit}"))
            };
            let modes: Vec<String> = axis.modes.iter().map(u8::to_string).collect();
            let _ = write!(
                text,
                "  axis {position}: modes {}, motor encoder {}, rated torque {}, status {:#06x}",
                modes.join(" "),
                number(axis.encoder_counts, "counts a turn"),
                number(axis.rated_torque_mnm, "mNm"),
                axis.statusword
            );
            if let Some(counts) = axis.link_encoder_counts {
                let _ = write!(text, ", second encoder {counts} counts a turn");
            }
            if axis.error_code != 0 {
                let _ = write!(text, ", error {:#06x}", axis.error_code);
            }
            text.push('\n');
        }
    }
    text
}
