//! [`Smsd`] over the standard protocol.

use super::client::SmsdUsbClient;
use super::primitives::model_in;
use super::table::is_operand;
use crate::connect::BoxFuture;
use crate::error::Error;
use crate::smsd::driver::{Answer, Progress, Smsd, Step};
use crate::smsd::network::LanParameters;
use crate::smsd::registers::Reading;
use crate::smsd::settings::Identity;
use crate::smsd::snapshot::{ProgramState, Snapshot};
use crate::smsd::value::Slot;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::status::Status;

impl Smsd for SmsdUsbClient {
    fn name(&self) -> BoxFuture<'_, String> {
        Box::pin(self.called())
    }

    fn connections(&self) -> BoxFuture<'_, u64> {
        Box::pin(async { self.session.lock().await.wire.openings() })
    }

    fn log_in(&self) -> Answer<'_, ()> {
        Box::pin(self.enter())
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        Box::pin(async { self.session.lock().await.wire.close() })
    }

    fn sent_for(&self, step: Step) -> Answer<'_, Vec<String>> {
        Box::pin(self.packets_for(step))
    }

    fn check_readable(&self, reg: Reg) -> Result<(), Error> {
        SmsdUsbClient::readable(reg)
    }

    fn supposed(&self, reg: Reg) -> i64 {
        self.last_written(reg)
    }

    fn keeps(&self, reg: Reg) -> bool {
        is_operand(reg)
    }

    fn read_at(&self, reg: Reg, index: u16) -> Answer<'_, i64> {
        Box::pin(async move {
            let slot = Slot::new(reg, index)?;
            let values = self.read_slots(&[slot]).await?;
            values.first().copied().ok_or_else(|| Error::Device(format!("the reply has no value for {slot}")))
        })
    }

    fn read_row(&self, reg: Reg) -> Answer<'_, Vec<i64>> {
        Box::pin(async move {
            let slots: Vec<Slot> = Slot::all(reg.info()).collect();
            self.read_slots(&slots).await
        })
    }

    fn read_many<'a>(&'a self, regs: &'a [Reg]) -> Answer<'a, Vec<i64>> {
        Box::pin(async move {
            let slots = regs.iter().map(|reg| Slot::new(*reg, 0)).collect::<Result<Vec<Slot>, Error>>()?;
            self.read_slots(&slots).await
        })
    }

    fn read_all(&self) -> Answer<'_, Vec<Reading>> {
        Box::pin(self.read_map())
    }

    fn write_at(&self, reg: Reg, index: u16, value: i64) -> Answer<'_, ()> {
        Box::pin(async move { self.write_slot(Slot::new(reg, index)?, value).await })
    }

    fn write_many<'a>(&'a self, values: &'a [(Reg, i64)]) -> Answer<'a, ()> {
        Box::pin(async move {
            let slots = values.iter().map(|(reg, value)| Ok((Slot::new(*reg, 0)?, *value)));
            self.write_slots(slots.collect::<Result<Vec<(Slot, i64)>, Error>>()?).await
        })
    }

    fn identity(&self) -> Answer<'_, Identity> {
        Box::pin(self.what_it_is())
    }

    fn model(&self) -> Answer<'_, Option<Model>> {
        Box::pin(async move { Ok(self.versions_if_told().await?.and_then(model_in)) })
    }

    fn snapshot(&self) -> Answer<'_, Snapshot> {
        Box::pin(self.look())
    }

    fn status(&self) -> Answer<'_, Status> {
        Box::pin(self.status_now())
    }

    fn program(&self) -> Answer<'_, ProgramState> {
        Box::pin(self.program_now())
    }

    fn motor_configuration(&self) -> Answer<'_, MotorConfiguration> {
        Box::pin(self.configuration())
    }

    fn set_motor_configuration<'a>(&'a self, motor: &'a MotorConfiguration) -> Answer<'a, ()> {
        Box::pin(self.set_configuration(motor))
    }

    fn change_password(&self, password: u64) -> Answer<'_, ()> {
        Box::pin(self.set_password(password))
    }

    fn lan_parameters(&self) -> Answer<'_, LanParameters> {
        Box::pin(self.lan_now())
    }

    fn configure_lan<'a>(&'a self, lan: &'a LanParameters) -> Answer<'a, ()> {
        Box::pin(self.set_lan(lan))
    }

    fn command(&self, opcode: Opcode, operand: Option<i64>) -> Answer<'_, ()> {
        Box::pin(self.carry_out(opcode, operand))
    }

    fn trigger(&self, coil: Reg) -> Answer<'_, ()> {
        Box::pin(self.let_act(coil))
    }

    fn store_program_with<'a>(
        &'a self,
        area: u8,
        program: &'a [Instruction],
        progress: Progress<'a>,
    ) -> Answer<'a, ()> {
        Box::pin(self.store(area, program, progress))
    }

    fn fetch_program_with<'a>(&'a self, area: u8, progress: Progress<'a>) -> Answer<'a, Vec<Instruction>> {
        Box::pin(self.fetch(area, progress))
    }

    fn erase_program(&self, area: u8) -> Answer<'_, ()> {
        Box::pin(async move { self.store(area, &[], &mut |_| {}).await })
    }
}
