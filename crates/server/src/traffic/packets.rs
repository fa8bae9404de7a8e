//! Packets of the SMSD's standard protocol in words: `SET_MAX_SPEED 100`, and `OK, HiZ STOP READY` for the reply.

use super::modbus::flags;
use super::words::Meaning;
use stepdrive_asm::bare;
use stepdrive_proto::smsd::{Framing, Packet, PacketReader, decode_reply, decode_request};
use stepdrive_spec::smsd::instructions::Instruction;
use stepdrive_spec::smsd::standard::{
    Answer, COUNTER_ROWS, Code, Firmware, LanParameters, PacketType, Reply, Request, Versions,
};
use stepdrive_spec::time::Instant;

/// A request in a packet, and the reply to it in another, both as they were on the line.
pub(crate) fn meanings(
    framing: Framing,
    firmware: Firmware,
    request: &[u8],
    reply: &[u8],
) -> (Meaning, Meaning) {
    let mut asked = None;
    let meant = with_packet(framing, request, |packet, id| {
        let decoded = decode_request(packet, firmware);
        let meant = match &decoded {
            Ok(request) => request_meaning(request),
            Err(malformed) => Meaning::bad(format!("{}: {}", kind(packet), malformed.code().about())),
        };
        asked = decoded.ok().map(|request| (request, id));
        meant
    });
    let answered = with_packet(framing, reply, |packet, id| match &asked {
        _ if packet.is_greeting() => Meaning::good("asks for the password"),
        Some((_, asked)) if *asked != id => {
            Meaning::bad(format!("a reply with identification {id}, not {asked}"))
        }
        Some((request, _)) => reply_meaning(packet, request),
        // Whatever it is, it has a status structure, which answers every request.
        None => reply_meaning(packet, &Request::Command(0)),
    });
    (meant, answered)
}

/// What the packet in these bytes means.
fn with_packet(framing: Framing, bytes: &[u8], mean: impl FnOnce(&Packet<'_>, u8) -> Meaning) -> Meaning {
    let (mut reader, mut rest) = (PacketReader::new(framing), bytes);
    let meaning = match reader.take(Instant::ZERO, &mut rest) {
        None => return Meaning::bad("a packet without its end"),
        Some(taken) => match taken.packet {
            Ok(packet) => mean(&packet, taken.id),
            Err(malformed) => Meaning::bad(format!("no packet: {}", malformed.code().about())),
        },
    };
    match rest.len() {
        0 => meaning,
        more => Meaning::bad(format!("{}, and {more} more bytes", meaning.text)),
    }
}

fn kind(packet: &Packet<'_>) -> String {
    let known = PacketType::from_code(packet.packet_type);
    known.map_or_else(|| format!("type {}", packet.packet_type), |known| known.info().name.to_owned())
}

fn request_meaning(request: &Request) -> Meaning {
    Meaning::good(match request {
        Request::Command(word) => return instruction(*word),
        Request::Authorise(_) => "log in".to_owned(),
        Request::WriteMemory { area, words } => format!("write mem{area}: {} instructions", words.len()),
        Request::ReadMemory { area } => format!("read mem{area}"),
        Request::SetLan(lan) => format!("set the LAN parameters: {}", network(lan)),
        Request::GetLan => "read the LAN parameters".to_owned(),
        Request::SetPassword(_) => "set the password".to_owned(),
        Request::GetErrors => "read the counters of errors".to_owned(),
        Request::GetVersions => "read the versions".to_owned(),
    })
}

/// An instruction as programs are written.
fn instruction(word: u32) -> Meaning {
    match Instruction::from_word(word) {
        Ok(instruction) if !instruction.opcode.info().in_program => Meaning::good(instruction.opcode.name()),
        Ok(instruction) => Meaning::good(bare(instruction)),
        Err(error) => Meaning::bad(format!("{word:#010X}: {error}")),
    }
}

fn reply_meaning(packet: &Packet<'_>, request: &Request) -> Meaning {
    match decode_reply(packet, request) {
        Ok(Reply::Response(answer) | Reply::Powerstep01(answer)) => answer_meaning(&answer),
        Ok(Reply::Memory { area, words }) => {
            Meaning::good(format!("mem{area}: {} instructions", words.len()))
        }
        Ok(Reply::Lan(lan)) => Meaning::good(network(&lan)),
        Ok(Reply::Errors(counters)) => Meaning::good(counted(&counters)),
        Ok(Reply::Versions(versions)) => Meaning::good(made(&versions)),
        Err(error) => Meaning::bad(error.to_string()),
    }
}

fn answer_meaning(answer: &Answer) -> Meaning {
    let Answer { status, code, data } = *answer;
    let value = match code {
        Code::GetAbsPos => format!(" {}", data.cast_signed()),
        Code::GetMode | Code::GetStatusInEvent | Code::GetStack => format!(" {data:#X}"),
        Code::GetElPos | Code::GetSpeed | Code::GetMinSpeed | Code::GetMaxSpeed => format!(" {data}"),
        Code::Ok
        | Code::OkAccess
        | Code::ErrorAccess
        | Code::ErrorAccessTimeout
        | Code::ErrorXor
        | Code::ErrorNoCommand
        | Code::ErrorLen
        | Code::ErrorRange
        | Code::ErrorWrite
        | Code::ErrorRead
        | Code::ErrorPrograms
        | Code::ErrorWriteSetup
        | Code::NoNext
        | Code::EndPrograms
        | Code::StatusReleSet
        | Code::StatusReleClr => String::new(),
    };
    Meaning { text: format!("{code}{value}, {}", flags(status)), bad: code.is_error() }
}

fn network(lan: &LanParameters) -> String {
    let [a, b, c, d] = lan.ip;
    let id = lan.id.map_or(String::new(), |id| format!(", ID {id}"));
    let dhcp = if lan.dhcp == 2 { ", DHCP" } else { "" };
    format!("{a}.{b}.{c}.{d}:{}{id}{dhcp}", lan.port)
}

/// The counters that have counted something.
fn counted(counters: &[u32]) -> String {
    let rows = COUNTER_ROWS.iter().zip(counters).filter(|(_, count)| **count != 0);
    let rows: Vec<String> = rows.map(|((_, name, _), count)| format!("{name} {count}")).collect();
    if rows.is_empty() { "no errors, no starts".to_owned() } else { rows.join(", ") }
}

fn made(versions: &Versions) -> String {
    let Versions { hardware: [model, hardware], firmware: [major, minor], protocol } = versions;
    format!("hardware {model}.{hardware}, firmware {major}.{minor}, protocol {protocol}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_proto::smsd::{PacketBuf, encode_greeting, encode_reply, encode_request};
    use stepdrive_spec::smsd::instructions::Opcode;
    use stepdrive_spec::smsd::status::Status;

    const READY: Status = Status {
        hi_z: true,
        ready: true,
        sw_f: false,
        sw_evn: false,
        forward: true,
        motion: stepdrive_spec::smsd::status::MotStatus::Stopped,
        cmd_error: false,
    };

    fn said(framing: Framing, request: &Request, reply: &Reply) -> (Meaning, Meaning) {
        let (mut asked, mut answered) = (PacketBuf::new(), PacketBuf::new());
        encode_request(&mut asked, framing, 2, 250, request);
        encode_reply(&mut answered, framing, 2, 250, reply);
        meanings(framing, Firmware::Modbus, &asked, &answered)
    }

    fn command(opcode: Opcode, data: u32) -> Request {
        Request::Command(Instruction { opcode, data }.word())
    }

    fn answer(code: Code, data: u32) -> Reply {
        Reply::Powerstep01(Answer { status: READY, code, data })
    }

    #[test]
    fn instructions_are_written_as_in_programs() {
        for framing in [Framing::Stuffed, Framing::Raw] {
            let (asked, answered) = said(framing, &command(Opcode::SetMaxSpeed, 250), &answer(Code::Ok, 0));
            assert_eq!(asked, Meaning::good("SET_MAX_SPEED 250"));
            assert_eq!(answered, Meaning::good("OK, HiZ STOP READY DIR"));
        }
        let position = answer(Code::GetAbsPos, (-7_i32).cast_unsigned());
        let (asked, answered) = said(Framing::Stuffed, &command(Opcode::GetAbsPos, 0), &position);
        assert_eq!(asked, Meaning::good("GET_ABS_POS"));
        assert_eq!(answered, Meaning::good("GET_ABS_POS -7, HiZ STOP READY DIR"));
    }

    #[test]
    fn a_password_is_not_shown() {
        let (asked, answered) =
            said(Framing::Raw, &Request::Authorise(1_234_567), &answer(Code::ErrorAccess, 0));
        assert_eq!(asked, Meaning::good("log in"));
        assert_eq!(answered, Meaning::bad("ERROR_ACCESS, HiZ STOP READY DIR"));
    }

    #[test]
    fn what_is_read_is_told_in_short() {
        let mut counters = [0; 17];
        (counters[0], counters[13]) = (3, 1);
        let (_, answered) = said(Framing::Raw, &Request::GetErrors, &Reply::Errors(counters));
        assert_eq!(answered, Meaning::good("N_STARTS 3, ERROR_COMMAND_POWERSTEP01 1"));
        let versions = Versions { hardware: [6, 1], firmware: [1, 2], protocol: 2 };
        let (_, answered) = said(Framing::Raw, &Request::GetVersions, &Reply::Versions(versions));
        assert_eq!(answered, Meaning::good("hardware 6.1, firmware 1.2, protocol 2"));
    }

    #[test]
    fn the_call_to_log_in_comes_without_being_asked() {
        let mut greeting = PacketBuf::new();
        encode_greeting(&mut greeting, 2);
        let (_, said) = meanings(Framing::Raw, Firmware::Standard, &[], &greeting);
        assert_eq!(said, Meaning::good("asks for the password"));
    }

    #[test]
    fn what_is_no_packet_is_bad() {
        let (mut asked, mut answered) = (PacketBuf::new(), PacketBuf::new());
        encode_request(&mut asked, Framing::Raw, 2, 1, &Request::GetErrors);
        encode_reply(&mut answered, Framing::Raw, 2, 2, &answer(Code::Ok, 0));
        let mean = |asked: &[u8], answered: &[u8]| meanings(Framing::Raw, Firmware::Modbus, asked, answered);
        assert_eq!(mean(&asked, &answered).1, Meaning::bad("a reply with identification 2, not 1"));
        let mut damaged = asked.to_vec();
        damaged[2] ^= 1;
        assert_eq!(mean(&damaged, &[]).0, Meaning::bad("no packet: The checksum is wrong."));
        assert_eq!(mean(&asked[..5], &[]).0, Meaning::bad("a packet without its end"));
    }
}
