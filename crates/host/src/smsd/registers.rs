//! Typed access to the register map.

use super::client::{Manner, SmsdClient};
use super::driver::Smsd;
use super::options::WordOrder;
use super::session::Trouble;
use super::trouble::Asked;
use super::value::{Run, Slot, runs};
use crate::Error;
use stepdrive_spec::modbus::{Bits, MAX_READ_BITS, MAX_READ_WORDS, MAX_WRITE_WORDS, Request, Table, Words};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Limits, REGISTERS, Reg};

/// A register and what it reads as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Which row of the map.
    pub reg: Reg,
    /// Which register of the row, from 0.
    pub index: u16,
    /// Its value; bits as 0 and 1.
    pub value: i64,
}

impl SmsdClient {
    /// Reads one of several registers in a row of the map, as an octet of `IP {}`. Bits read as 0 and 1.
    ///
    /// # Errors
    /// [`Error::Line`], [`Error::NotAuthorised`], [`Error::Device`]; [`Error::Usage`] when the row has not so many.
    pub async fn read_at(&self, reg: Reg, index: u16) -> Result<i64, Error> {
        let slots = [Slot::new(reg, index)?];
        let run = Run { slots: &slots };
        let values = self.read_run(run).await?;
        values.first().copied().ok_or_else(|| unexpected(run))
    }

    /// Reads all registers of a row of the map.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn read_row(&self, reg: Reg) -> Result<Vec<i64>, Error> {
        let slots: Vec<Slot> = Slot::all(reg.info()).collect();
        self.read_run(Run { slots: &slots }).await
    }

    /// Reads registers, neighbours in one request; of several in a row of the map the first. The values stand in the
    /// order of `regs`. Only those of one request are of the same moment.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn read_many(&self, regs: &[Reg]) -> Result<Vec<i64>, Error> {
        let mut slots = Vec::with_capacity(regs.len());
        for reg in regs {
            slots.push(Slot::new(*reg, 0)?);
        }
        slots.sort_unstable_by_key(|slot| slot.row.id);
        slots.dedup_by_key(|slot| slot.row.id);
        let readings = self.read_slots(&slots).await?;
        let mut values = Vec::with_capacity(regs.len());
        for reg in regs {
            let reading = readings.iter().find(|reading| reading.reg == *reg);
            values.extend(reading.map(|reading| reading.value));
        }
        Ok(values)
    }

    /// Reads every register that tells something, in the order of the map.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn read_all(&self) -> Result<Vec<Reading>, Error> {
        let slots: Vec<Slot> = REGISTERS.iter().flat_map(Slot::all).filter(|slot| slot.tells()).collect();
        self.read_slots(&slots).await
    }

    /// Writes one of several registers in a row of the map. What acts (`CMD`, `MEM_CMD`, `Password_CMD`, coils that act) is
    /// sent once and never repeated.
    ///
    /// # Errors
    /// [`Error::Usage`] when the register cannot be written, or not with this value: nothing was sent then.
    /// [`Error::Refused`] when the controller refuses it, as while the motor turns. [`Error::Line`], [`Error::NotAuthorised`],
    /// [`Error::Device`]. [`Error::Partly`] when no reply came, however often it was written; [`Error::Uncertain`] when what
    /// acts was not answered.
    pub async fn write_at(&self, reg: Reg, index: u16, value: i64) -> Result<(), Error> {
        let slot = Slot::new(reg, index)?;
        let model = self.model_for(&[(slot, value)]).await?;
        slot.check(value, model)?;
        if slot.acts() {
            return self.act(slot, value).await;
        }
        self.write_run(Run { slots: &[slot] }, &[value], model).await
    }

    /// Writes registers that hold a value, neighbours in one request. All are checked before anything is sent.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`]. A request refused leaves those before it written, in the order of the map: the error
    /// names the registers that it is about.
    pub async fn write_many(&self, values: &[(Reg, i64)]) -> Result<(), Error> {
        let slots = values.iter().map(|(reg, value)| Ok((Slot::new(*reg, 0)?, *value)));
        self.write_slots(slots.collect::<Result<Vec<(Slot, i64)>, Error>>()?).await
    }

    /// Reads registers that are in the order of the map.
    async fn read_slots(&self, slots: &[Slot]) -> Result<Vec<Reading>, Error> {
        let mut readings = Vec::with_capacity(slots.len());
        for run in runs(slots, most_to_read) {
            let values = self.read_run(run).await?;
            let reading =
                |(slot, value): (&Slot, i64)| Reading { reg: slot.row.id, index: slot.index, value };
            readings.extend(run.slots.iter().zip(values).map(reading));
        }
        Ok(readings)
    }

    /// Reads a run in one request.
    pub(super) async fn read_run(&self, run: Run<'_>) -> Result<Vec<i64>, Error> {
        let Some(request) = run.read() else { return Err(unexpected(run)) };
        let manner = if run.is_open() { Manner::OPEN } else { Manner::REPEATED };
        let mut outcome = self.ask(&request, manner).await;
        if run.is_open() && matches!(outcome, Err(Trouble::Exception(_))) {
            // Not every controller may let these be read before authorisation.
            outcome = Box::pin(self.ask(&request, Manner::REPEATED)).await;
        }
        let reply = match outcome {
            Ok(reply) => reply,
            Err(trouble) => return Err(Asked::Read(run).explain(trouble, &self.name().await)),
        };
        let order = if run.has_long_values() { self.word_order().await? } else { WordOrder::LowFirst };
        run.values(&reply, order).ok_or_else(|| unexpected(run))
    }

    /// Checks all and writes it.
    pub(super) async fn write_slots(&self, mut values: Vec<(Slot, i64)>) -> Result<(), Error> {
        values.sort_by_key(|(slot, _)| (slot.row.id, slot.index));
        let model = self.model_for(&values).await?;
        for (slot, value) in &values {
            slot.check(*value, model)?;
            if slot.acts() {
                return Err(Error::Usage(format!("{slot} acts and is written alone; nothing was sent")));
            }
        }
        let (slots, values): (Vec<Slot>, Vec<i64>) = values.into_iter().unzip();
        let mut rest = values.as_slice();
        for run in runs(&slots, |_| MAX_WRITE_WORDS) {
            let (values, behind) = rest.split_at_checked(run.slots.len()).unwrap_or((rest, &[]));
            self.write_run(run, values, model).await?;
            rest = behind;
        }
        Ok(())
    }

    /// Writes a run of registers that hold a value, checked before.
    async fn write_run(&self, run: Run<'_>, values: &[i64], model: Option<Model>) -> Result<(), Error> {
        let order = if run.has_long_values() { self.word_order().await? } else { WordOrder::LowFirst };
        let request = write(run, values, order).ok_or_else(|| unexpected(run))?;
        match self.ask(&request, Manner::REPEATED).await {
            Ok(_) => Ok(()),
            Err(trouble) => Err(Asked::Write(run, values, model).explain(trouble, &self.name().await)),
        }
    }

    /// The model, where the range of a value depends on it.
    async fn model_for(&self, values: &[(Slot, i64)]) -> Result<Option<Model>, Error> {
        if values.iter().any(|(slot, _)| matches!(slot.row.limits, Limits::ByModel(..))) {
            return self.model().await;
        }
        Ok(None)
    }
}

/// The request that writes values to a run.
pub(super) fn write(run: Run<'_>, values: &[i64], order: WordOrder) -> Option<Request> {
    let first = run.slots.first()?;
    let address = first.address();
    if first.row.table == Table::Coils {
        let bits: Bits = values.iter().map(|value| *value != 0).collect();
        return Some(match values {
            [value] => Request::WriteCoil { address, value: *value != 0 },
            _ => Request::WriteCoils { address, values: bits },
        });
    }
    let mut words = Words::new();
    for (slot, value) in run.slots.iter().zip(values) {
        slot.put(&mut words, *value, order);
    }
    Some(match words.as_slice() {
        [value] => Request::WriteRegister { address, value: *value },
        _ => Request::WriteRegisters { address, values: words },
    })
}

fn most_to_read(table: Table) -> usize {
    if table.is_bits() { MAX_READ_BITS } else { MAX_READ_WORDS }
}

/// A reply that does not fit its request; the codec lets none through.
fn unexpected(run: Run<'_>) -> Error {
    Error::Device(format!("the reply has no value for {run}"))
}
