//! MCAP: recordings of ours, and bags of ROS.

use super::{Log, Source};
use crate::frame::Frame;
use crate::mapping::{Mapping, MappingFile, mapping_beside};
use crate::ros::Bag;
use crate::{Guess, GuessJoint, ReadProblem, Recording, mcap_file};
use std::path::Path;

pub(crate) struct Mcap;

impl Source for Mcap {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(mcap::MAGIC)
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        if !mcap_file::is_bag(path)? {
            return Err(ReadProblem::MappedMcap);
        }
        let mut bag = Bag::default();
        mcap_file::read_bag(path, &mut bag)?;
        bag.into_frame()
    }

    fn read(&self, path: &Path, mapping: &MappingFile<'_>) -> Result<Recording, ReadProblem> {
        if !mapping.is_given() && !mcap_file::is_bag(path)? {
            return mcap_file::read_table(path);
        }
        let (mapping, mapping_path) = mapping.load()?;
        self.frame(path, &mapping)?
            .into_table(&mapping, &mapping_path)
    }

    fn read_guessing(
        &self,
        path: &Path,
        joints: &[GuessJoint],
    ) -> Result<(Recording, Option<Guess>), ReadProblem> {
        if !mcap_file::is_bag(path)? {
            return Ok((mcap_file::read_table(path)?, None));
        }
        let frame = self.frame(path, &Mapping::default())?;
        frame.into_guessed_table(&mapping_beside(path), joints)
    }
}
