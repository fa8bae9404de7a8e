//! Modbus TCP on the link.

use super::common::link::Fault;
use super::common::station::{self, Protocol, World};
use stepdrive_drive::smsd::{Config, Memory, Session, WordOrder as DriveOrder};
use stepdrive_host::Connect;
use stepdrive_host::smsd::{SmsdClient, SmsdOptions, WordOrder};
use stepdrive_proto::modbus::{
    Adu, Frame, Refusal, Split, decode_request, encode_refusal, encode_reply, split,
};
use stepdrive_spec::modbus::{Reply, Request, Table};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, Reg, Register};
use stepdrive_spec::smsd::standard::{Firmware, VERSION_2};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Modbus;

pub(crate) type Bench = station::Bench<Modbus>;

/// Something that acted, in the drive.
pub(crate) type Act = (Reg, u16);

impl Bench {
    /// An SMSD-4.2LAN fresh from the factory, and a client that knows as much.
    pub(crate) fn new() -> Bench {
        Bench::of(WordOrder::LowFirst, SmsdOptions::default())
    }

    /// The same, logged in.
    pub(crate) async fn ready() -> Bench {
        Bench::new().logged_in().await
    }

    /// A controller with this word order, and any client.
    pub(crate) fn of(order: WordOrder, options: SmsdOptions) -> Bench {
        Bench::with(Model::Smsd42, order, Memory::factory(), options)
    }

    pub(crate) fn with(model: Model, order: WordOrder, memory: Memory, options: SmsdOptions) -> Bench {
        let word_order = match order {
            WordOrder::LowFirst => DriveOrder::LowFirst,
            WordOrder::HighFirst => DriveOrder::HighFirst,
        };
        let config = Config {
            model,
            word_order,
            port: 502,
            autonomous: false,
            firmware: Firmware::Modbus,
            protocol_version: VERSION_2,
        };
        Bench::begin(Modbus, config, memory, options)
    }
}

impl Protocol for Modbus {
    type Client = SmsdClient;
    type Act = Act;
    type Session = Session;
    type Reply = Vec<u8>;

    fn client(&self, reach: impl Connect + 'static, options: SmsdOptions) -> SmsdClient {
        SmsdClient::new(reach, options)
    }

    fn session(&self) -> Session {
        Session::new()
    }

    fn size(&self, bytes: &[u8]) -> Option<usize> {
        match split(bytes) {
            Split::Frame { size, .. } => Some(size),
            Split::Incomplete { .. } => None,
            Split::Foreign { .. } | Split::Broken { .. } => panic!("the client sends frames of Modbus"),
        }
    }

    fn answers(
        &self,
        world: &mut World<Modbus>,
        session: &mut Session,
        bytes: &[u8],
        fault: &Fault,
    ) -> Vec<Vec<u8>> {
        let Split::Frame { frame, .. } = split(bytes) else { panic!("TCP loses nothing") };
        if let Fault::Except(exception) = fault {
            return vec![refused(&frame, Refusal { function: frame.pdu[0], exception: *exception })];
        }
        answer(world, session, &frame).into_iter().collect()
    }

    fn wire(&self, reply: &Vec<u8>) -> Vec<u8> {
        reply.clone()
    }

    fn renumbered(&self, reply: &Vec<u8>, by: i8) -> Vec<u8> {
        with(reply, 1, by)
    }

    fn spoilt(&self, reply: &Vec<u8>, fault: &Fault) -> Vec<u8> {
        if let Fault::Register(place, value) = fault {
            let mut reply = reply.clone();
            let at = 9 + 2 * place;
            reply[at..at + 2].copy_from_slice(&value.to_be_bytes());
            return reply;
        }
        // The protocol, or the unit.
        with(reply, if *fault == Fault::ForeignFirst { 3 } else { 6 }, 1)
    }

    fn is_over_lan(&self) -> bool {
        true
    }
}

/// Answers a frame; `None` when it is for another unit.
fn answer(world: &mut World<Modbus>, session: &mut Session, frame: &Frame<'_>) -> Option<Vec<u8>> {
    world.requests += 1;
    if world.forgets() {
        *session = Session::new();
    }
    if ![0, 255, world.machine.drive().unit()].contains(&frame.unit) || !world.machine.powered() {
        return None;
    }
    let request = match decode_request(frame.pdu) {
        Ok(request) => request,
        Err(refusal) => return Some(refused(frame, refusal)),
    };
    let now = world.now();
    let outcome = world.machine.handle(now, session, &request);
    if outcome == Ok(Reply::Written) {
        world.acts.extend(act(&request));
    }
    let mut reply = Adu::new();
    encode_reply(&mut reply, frame.transaction, frame.unit, &request, &outcome);
    Some(reply.to_vec())
}

fn refused(frame: &Frame<'_>, refusal: Refusal) -> Vec<u8> {
    let mut reply = Adu::new();
    encode_refusal(&mut reply, frame.transaction, frame.unit, refusal);
    reply.to_vec()
}

/// What a request that was carried out has let act.
fn act(request: &Request) -> Option<Act> {
    let (table, address, value) = match request {
        Request::WriteCoil { address, value } => (Table::Coils, *address, u16::from(*value)),
        Request::WriteRegister { address, value } => (Table::HoldingRegisters, *address, *value),
        Request::WriteRegisters { .. }
        | Request::WriteCoils { .. }
        | Request::ReadBits { .. }
        | Request::ReadWords { .. } => return None,
    };
    let row = Register::at(table, address)?;
    // Logging in is asked for as often as it takes.
    let logs_in = row.id == Reg::PasswordCmd && value == 0;
    let acts = row.access == Access::Trigger || matches!(row.id, Reg::Cmd | Reg::MemCmd | Reg::PasswordCmd);
    (acts && !logs_in).then_some((row.id, value))
}

/// A frame with one of its bytes changed.
fn with(frame: &[u8], place: usize, by: i8) -> Vec<u8> {
    let mut frame = frame.to_vec();
    frame[place] = frame[place].wrapping_add_signed(by);
    frame
}
