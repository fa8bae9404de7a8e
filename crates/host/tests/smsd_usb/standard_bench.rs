//! The standard protocol on the link: USB, or TCP with the standard firmware.

use super::common::link::Fault;
use super::common::station::{self, Protocol, World};
use std::sync::atomic::{AtomicBool, Ordering};
use stepdrive_drive::smsd::{Config, Memory, StandardSession, WordOrder};
use stepdrive_host::Connect;
use stepdrive_host::smsd::{Framing, SmsdOptions, SmsdUsbClient};
use stepdrive_proto::smsd::{PacketBuf, PacketReader, STOP, decode_request, encode_greeting, encode_reply};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{Answer, Code, Firmware, LanParameters, Reply, Request, VERSION_2};
use stepdrive_spec::smsd::status::Status;

#[derive(Debug)]
pub(crate) struct Standard {
    framing: Framing,
    firmware: Firmware,
    version: u8,
    /// Connections over TCP do not begin with a greeting.
    rude: AtomicBool,
}

pub(crate) type Bench = station::Bench<Standard>;

/// Something that acted, in the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Act {
    Instruction(Opcode),
    Password,
}

/// What a test wants of its controller.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setup {
    pub(crate) model: Model,
    pub(crate) framing: Framing,
    pub(crate) firmware: Firmware,
    pub(crate) version: u8,
    pub(crate) options: SmsdOptions,
}

impl Default for Setup {
    /// An SMSD-4.2LAN fresh from the factory at its USB port, and a client that knows as much.
    fn default() -> Setup {
        Setup {
            model: Model::Smsd42,
            framing: Framing::Stuffed,
            firmware: Firmware::Modbus,
            version: VERSION_2,
            options: SmsdOptions::default(),
        }
    }
}

impl Setup {
    /// The same over TCP, with the standard firmware.
    pub(crate) fn raw() -> Setup {
        Setup { framing: Framing::Raw, firmware: Firmware::Standard, ..Setup::default() }
    }
}

impl Bench {
    pub(crate) fn new() -> Bench {
        Bench::of(&Setup::default())
    }

    /// A controller at its USB port, a client logged in.
    pub(crate) async fn ready() -> Bench {
        Bench::ready_as(&Setup::default()).await
    }

    pub(crate) async fn ready_as(setup: &Setup) -> Bench {
        Bench::of(setup).logged_in().await
    }

    pub(crate) fn of(setup: &Setup) -> Bench {
        let config = Config {
            model: setup.model,
            word_order: WordOrder::LowFirst,
            port: 502,
            autonomous: false,
            firmware: setup.firmware,
            protocol_version: setup.version,
        };
        let protocol = Standard {
            framing: setup.framing,
            firmware: setup.firmware,
            version: setup.version,
            rude: AtomicBool::new(false),
        };
        Bench::begin(protocol, config, Memory::factory(), setup.options)
    }

    pub(crate) fn greet_nobody(&self) {
        self.station.protocol.rude.store(true, Ordering::Relaxed);
    }
}

/// What a connection has come to: who is logged in, and the packet that is under way.
pub(crate) struct Listener {
    pub(crate) session: StandardSession,
    reader: PacketReader,
}

impl Standard {
    fn stranger(&self) -> StandardSession {
        if self.framing == Framing::Raw { StandardSession::lan() } else { StandardSession::usb() }
    }

    fn encoded(&self, id: u8, reply: &Reply) -> Vec<u8> {
        let mut packet = PacketBuf::new();
        encode_reply(&mut packet, self.framing, self.version, id, reply);
        packet.to_vec()
    }
}

impl Protocol for Standard {
    type Client = SmsdUsbClient;
    type Act = Act;
    type Session = Listener;
    type Reply = (u8, Reply);

    fn client(&self, reach: impl Connect + 'static, options: SmsdOptions) -> SmsdUsbClient {
        SmsdUsbClient::new(reach, self.framing, options)
    }

    fn session(&self) -> Listener {
        Listener { session: self.stranger(), reader: PacketReader::new(self.framing) }
    }

    fn greeting(&self) -> Vec<u8> {
        let mut packet = PacketBuf::new();
        if self.framing == Framing::Raw && !self.rude.load(Ordering::Relaxed) {
            encode_greeting(&mut packet, self.version);
        }
        packet.to_vec()
    }

    fn size(&self, bytes: &[u8]) -> Option<usize> {
        let size = match self.framing {
            Framing::Stuffed => bytes.iter().position(|byte| *byte == STOP)? + 1,
            Framing::Raw => 6 + usize::from(u16::from_le_bytes([*bytes.get(4)?, *bytes.get(5)?])),
        };
        (bytes.len() >= size).then_some(size)
    }

    fn answers(
        &self,
        world: &mut World<Standard>,
        listener: &mut Listener,
        mut bytes: &[u8],
        fault: &Fault,
    ) -> Vec<(u8, Reply)> {
        let now = world.now();
        let mut replies = Vec::new();
        while let Some(taken) = listener.reader.take(now, &mut bytes) {
            if let Fault::Refuse(code) = fault {
                replies.push((taken.id, refusal(*code)));
                continue;
            }
            world.requests += 1;
            if world.forgets() {
                listener.session = self.stranger();
            }
            let request = taken.packet.and_then(|packet| decode_request(&packet, self.firmware));
            let session = &mut listener.session;
            let reply = world.machine.handle_standard(now, session, request.as_ref().map_err(|error| *error));
            if let (Ok(request), Some(reply)) = (&request, &reply) {
                world.acts.extend(act(request, reply));
            }
            replies.extend(reply.map(|reply| (taken.id, reply)));
        }
        replies
    }

    fn wire(&self, (id, reply): &(u8, Reply)) -> Vec<u8> {
        self.encoded(*id, reply)
    }

    fn renumbered(&self, (id, reply): &(u8, Reply), by: i8) -> Vec<u8> {
        self.encoded(id.wrapping_add_signed(by), reply)
    }

    fn spoilt(&self, (id, reply): &(u8, Reply), fault: &Fault) -> Vec<u8> {
        let spoilt =
            if let Fault::Value(value) = fault { with_value(reply, *value) } else { other_type(reply) };
        self.encoded(*id, &spoilt)
    }

    fn is_over_lan(&self) -> bool {
        self.framing == Framing::Raw
    }
}

/// What a request that was carried out has let act.
fn act(request: &Request, reply: &Reply) -> Option<Act> {
    match (request, reply) {
        (Request::Command(word), Reply::Powerstep01(_)) => {
            let opcode = Instruction::from_word(*word).expect("it was carried out").opcode;
            let name = opcode.name();
            let acts = !name.starts_with("GET_") || opcode == Opcode::GetStatusAndClr;
            let acts = acts && !name.starts_with("SET_") && !name.ends_with("_RELE");
            (acts && opcode != Opcode::StatusInEvent).then_some(Act::Instruction(opcode))
        }
        (Request::SetPassword(_), Reply::Response(Answer { code, .. })) if !code.is_error() => {
            Some(Act::Password)
        }
        _ => None,
    }
}

fn refusal(code: Code) -> Reply {
    Reply::Response(Answer { status: Status::from_word(0x13), code, data: 0 })
}

fn other_type(reply: &Reply) -> Reply {
    match reply {
        Reply::Response(answer) => Reply::Powerstep01(*answer),
        Reply::Powerstep01(answer) => Reply::Response(*answer),
        Reply::Memory { .. } | Reply::Lan(_) | Reply::Errors(_) | Reply::Versions(_) => reply.clone(),
    }
}

fn with_value(reply: &Reply, data: u32) -> Reply {
    match reply {
        Reply::Response(answer) => Reply::Response(Answer { data, ..*answer }),
        Reply::Powerstep01(answer) => Reply::Powerstep01(Answer { data, ..*answer }),
        Reply::Lan(lan) => Reply::Lan(LanParameters { dhcp: data.to_le_bytes()[0], ..*lan }),
        Reply::Memory { .. } | Reply::Errors(_) | Reply::Versions(_) => reply.clone(),
    }
}
