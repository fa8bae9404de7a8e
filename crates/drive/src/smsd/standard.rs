//! The requests of the standard binary protocol (ch. 6): what the controller speaks over USB, and over LAN with the standard
//! firmware. They reach the same controller as those by Modbus (decision 26).

use super::memory::Lan;
use super::{Smsd, StandardSession};
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::models::{FIRMWARE, HW_VER};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{
    Answer, Code, Firmware, LanParameters, Malformed, Reply, Request, Versions,
};
use stepdrive_spec::time::Instant;

impl Smsd {
    /// Answers a packet at `now`: a request, or what was wrong with one that carried none. `None` when nothing is answered,
    /// which is after `STOP_USB` and without supply.
    ///
    /// What is answered with an error has changed nothing; but a wrong password ends the login of its session, and locks out
    /// further attempts as by Modbus.
    pub fn handle_standard(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        request: Result<&Request, Malformed>,
    ) -> Option<Reply> {
        self.refresh(session);
        if !self.on || session.is_stopped() {
            return None;
        }
        let reply = self.answer(now, session, request).unwrap_or_else(|code| self.response(now, code));
        self.release_program(now);
        Some(reply)
    }

    fn answer(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        request: Result<&Request, Malformed>,
    ) -> Result<Reply, Code> {
        match request {
            Err(Malformed::Packet(code)) => Err(code),
            Ok(Request::Authorise(password)) => {
                let code = self.log_in(now, session, *password);
                Ok(self.response(now, code))
            }
            _ if !session.is_authorised() => Err(Code::ErrorAccess),
            Err(Malformed::Content(code)) => Err(code),
            Ok(request) => self.fulfil(now, session, request),
        }
    }

    /// Does what somebody who is logged in asks.
    fn fulfil(
        &mut self,
        now: Instant,
        session: &mut StandardSession,
        request: &Request,
    ) -> Result<Reply, Code> {
        match request {
            Request::Command(word) => {
                let instruction = self.instruction(*word)?;
                return self.instruct(now, session, instruction).map(Reply::Powerstep01);
            }
            Request::ReadMemory { area } => return Ok(self.read_memory(*area)),
            Request::GetLan => return Ok(Reply::Lan(self.lan_parameters())),
            Request::GetErrors => return Ok(Reply::Errors(self.counters())),
            Request::GetVersions => return Ok(Reply::Versions(self.versions())),
            Request::WriteMemory { area, words } => self.write_memory(*area, words)?,
            Request::SetLan(parameters) => self.set_lan(parameters)?,
            Request::SetPassword(password) => self.set_password(*password),
            // An attempt to log in has been dealt with.
            Request::Authorise(_) => {}
        }
        Ok(self.response(now, Code::Ok))
    }

    fn response(&self, now: Instant, code: Code) -> Reply {
        Reply::Response(Answer { status: self.status(now), code, data: 0 })
    }

    /// Puts a program into a memory area, as erasing, writing and setting the size by `MEM_CMD` would.
    fn write_memory(&mut self, area: u8, words: &[u32]) -> Result<(), Code> {
        for word in words {
            self.instruction(*word)?;
        }
        let area = area_number(area);
        if self.programs.is_busy(area, self.interpreter.executing()) {
            return Err(Code::ErrorWrite);
        }
        self.memory.load_program(area, words);
        self.unsaved.mark_program(area);
        Ok(())
    }

    /// ASSUMED: as many instructions as the program's size says are answered, not all 255.
    fn read_memory(&self, area: u8) -> Reply {
        let number = area_number(area);
        let stored = self.memory.area(number);
        let words = stored.words().iter().copied().take(stored.size().into()).collect();
        Reply::Memory { area: u8::try_from(number).unwrap_or(area), words }
    }

    /// Stores the LAN parameters and puts them into effect. Without a unit identifier, as the standard firmware has them,
    /// that stays.
    fn set_lan(&mut self, parameters: &LanParameters) -> Result<(), Code> {
        let LanParameters { mac, ip, subnet_mask, gateway, dns, port, dhcp, id } = *parameters;
        let id = id.unwrap_or(self.memory.lan.id);
        let values = [(Reg::LanId, id.into()), (Reg::LanPort, port), (Reg::LanDhcp, dhcp.into())];
        if !values.into_iter().all(|(reg, value)| self.fits(reg, value)) {
            return Err(Code::ErrorRange);
        }
        self.lan = Lan { id, mac, ip, subnet_mask, gateway, dns, port: self.chosen_port(port), dhcp };
        self.apply_network_configuration();
        Ok(())
    }

    /// The LAN parameters in effect.
    fn lan_parameters(&self) -> LanParameters {
        let Lan { id, mac, ip, subnet_mask, gateway, dns, port, dhcp } = self.memory.lan;
        let with_id = self.config.firmware == Firmware::Modbus;
        let (port, id) = (port.unwrap_or(self.config.port), with_id.then_some(id));
        LanParameters { mac, ip, subnet_mask, gateway, dns, port, dhcp, id }
    }

    fn versions(&self) -> Versions {
        Versions {
            hardware: [self.config.model.hw_major(), HW_VER],
            firmware: [FIRMWARE.0, FIRMWARE.1],
            protocol: self.config.protocol_version,
        }
    }
}

/// Areas above 3 count as 3.
fn area_number(area: u8) -> usize {
    usize::from(area).min(PROGRAM_AREAS - 1)
}
