//! The standard protocol, spoken to the same controller as Modbus.

mod access;
mod counters;
mod immediate;
mod memories;
mod motion;
pub(crate) mod requests;
mod settings;

use crate::bench::{Bench, PASSWORD, SECOND, config};
use stepdrive_drive::smsd::{Config, Memory, StandardSession};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{Answer, Code, LanParameters, Reply, Request, Words};

/// A controller with an authorised connection by Modbus, and a line on which the standard protocol is spoken.
#[derive(Clone, Debug)]
struct Port {
    bench: Bench,
    session: StandardSession,
}

impl Port {
    /// A USB port of an SMSD-4.2LAN fresh from the factory, logged in a second after power-up.
    fn new() -> Port {
        Port::with(config(Model::Smsd42))
    }

    /// The same of any controller.
    fn with(config: Config) -> Port {
        let mut port = Port::locked(config);
        port.bench.run_for(SECOND);
        assert_eq!(port.code(&Request::Authorise(PASSWORD)), Code::OkAccess);
        port
    }

    /// A USB port at the instant of power-up, where nobody has logged in.
    fn locked(config: Config) -> Port {
        Port { bench: Bench::with(config, Memory::factory(), 0), session: StandardSession::usb() }
    }

    fn ask(&mut self, request: &Request) -> Option<Reply> {
        self.bench.drive.handle_standard(self.bench.now, &mut self.session, Ok(request))
    }

    fn reply(&mut self, request: &Request) -> Reply {
        self.ask(request).expect("answered")
    }

    /// The code of an answer of type RESPONSE.
    fn code(&mut self, request: &Request) -> Code {
        let reply = self.reply(request);
        let Reply::Response(Answer { code, data: 0, .. }) = reply else {
            panic!("{request:?} was answered {reply:?}")
        };
        code
    }

    /// Gives an instruction that is carried out, as any word.
    fn give(&mut self, word: u32) -> Answer {
        let reply = self.reply(&Request::Command(word));
        let Reply::Powerstep01(answer) = reply else { panic!("{word:#X} was answered {reply:?}") };
        answer
    }

    /// Gives an instruction that is carried out.
    fn order(&mut self, opcode: Opcode, operand: i32) -> Answer {
        self.give(word(opcode, operand))
    }

    /// The value that an instruction asks for.
    fn get(&mut self, opcode: Opcode) -> u32 {
        self.order(opcode, 0).data
    }

    /// Asserts that a request is refused with this code, and changes nothing at all.
    fn assert_refused(&mut self, request: &Request, expected: Code) {
        let before = self.snapshot();
        assert_eq!(self.code(request), expected, "{request:?}");
        assert_eq!(self.snapshot(), before, "{request:?}");
    }

    /// All that the controller and both connections are.
    fn snapshot(&self) -> String {
        format!("{} {:?}", self.bench.snapshot(), self.session)
    }

    fn write_memory(&mut self, area: u8, program: &[Instruction]) -> Code {
        self.code(&Request::WriteMemory { area, words: words(program) })
    }

    fn read_memory(&mut self, area: u8) -> Vec<u32> {
        let reply = self.reply(&Request::ReadMemory { area });
        let Reply::Memory { area: told, words } = reply else { panic!("{reply:?}") };
        assert_eq!(told, area);
        words.to_vec()
    }

    fn lan(&mut self) -> LanParameters {
        let reply = self.reply(&Request::GetLan);
        let Reply::Lan(parameters) = reply else { panic!("{reply:?}") };
        parameters
    }
}

fn word(opcode: Opcode, operand: i32) -> u32 {
    Instruction::with_position(opcode, operand).word()
}

fn words(program: &[Instruction]) -> Words {
    program.iter().map(|line| line.word()).collect()
}
