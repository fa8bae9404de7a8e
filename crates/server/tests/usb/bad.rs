//! Input that is wrong: answered as the sheet says, nothing changes, and the next good packet is found.

use crate::bench::{Bench, Client, STANDARD, USB, code, instruction, packet, stuffed};

/// Packets that are wrong, unstuffed, and what each is answered with. LAN parameters have so many bytes.
fn wrong_packets(lan_size: usize) -> Vec<(Vec<u8>, u8)> {
    let mut bad_sum = packet(2, 7, &instruction(0x06, 500));
    bad_sum[0] ^= 1;
    vec![
        (bad_sum, code::ERROR_XOR),
        (packet(15, 7, &[]), code::ERROR_NO_COMMAND),
        (packet(1, 7, &[]), code::ERROR_NO_COMMAND),
        (packet(17, 7, &[]), code::ERROR_NO_COMMAND),
        (packet(255, 7, &[0; 1024]), code::ERROR_NO_COMMAND),
        (packet(0, 7, &[1; 7]), code::ERROR_LEN),
        (packet(2, 7, &[]), code::ERROR_LEN),
        (packet(2, 7, &[0x60; 3]), code::ERROR_LEN),
        (packet(3, 7, &[0; 1023]), code::ERROR_LEN),
        (packet(3, 7, &[0; 1024]), code::ERROR_LEN),
        (packet(7, 7, &[0]), code::ERROR_LEN),
        (packet(11, 7, &[1; 24]), code::ERROR_LEN),
        (packet(13, 7, &[1; 9]), code::ERROR_LEN),
        (packet(14, 7, &[0; 4]), code::ERROR_LEN),
        (packet(2, 7, &instruction(0x3F, 0)), code::ERROR_NO_COMMAND),
        (packet(2, 7, &[0x61, 0, 0, 0]), code::ERROR_RANGE),
        (packet(2, 7, &instruction(0x06, 15_601)), code::ERROR_RANGE),
        (packet(2, 7, &instruction(0x06, 15)), code::ERROR_RANGE),
        (packet(2, 7, &instruction(0x14, 8)), code::ERROR_RANGE),
        (packet(2, 7, &instruction(0x0E, 14)), code::ERROR_RANGE),
        (packet(3, 7, &instruction(0x3F, 0)), code::ERROR_NO_COMMAND),
        (packet(3, 7, &[0x68, 0, 0, 0]), code::ERROR_RANGE),
        (packet(11, 7, &vec![0; lan_size]), code::ERROR_RANGE),
        (packet(11, 7, &vec![1; 51 - lan_size]), code::ERROR_LEN),
    ]
}

/// Identification and code of each.
type Answers = Vec<(u8, u8)>;

/// Frames that are wrong as such, with the answers to each; code 0xFF is a packet of another type.
fn wrong_frames() -> Vec<(Vec<u8>, Answers)> {
    let good = stuffed(&packet(16, 9, &[]));
    let cut = |length: usize| [&[0xFA], &packet(2, 7, &instruction(6, 500))[..length], &[0xFB]].concat();
    let escape_at_end = [&[0xFA], &packet(16, 7, &[])[..], &[0xFE, 0xFB]].concat();
    let foreign_escape = [&[0xFA], &packet(16, 7, &[])[..5], &[0xFE, 0x00, 0xFB]].concat();
    let mut longer = packet(16, 7, &[]);
    longer[4] = 1;
    longer[0] = longer[0].wrapping_sub(1);
    let oversize = [&[0xFA][..], &[0, 2, 16, 7], &[1; 2000], &[0xFB]].concat();
    let claimed = [&[0xFA][..], &[0, 2, 3, 7, 0xFF, 0xFF, 1, 2, 3], &[0xFB]].concat();
    vec![
        (b"\xFA\xFB".to_vec(), vec![(0, code::ERROR_LEN)]),
        (cut(3), vec![(0, code::ERROR_LEN)]),
        (cut(5), vec![(7, code::ERROR_LEN)]),
        (cut(8), vec![(7, code::ERROR_XOR)]),
        (escape_at_end, vec![(7, code::ERROR_XOR)]),
        (foreign_escape, vec![(7, code::ERROR_XOR)]),
        (stuffed(&longer), vec![(7, code::ERROR_LEN)]),
        (oversize, vec![(7, code::ERROR_LEN)]),
        (claimed, vec![(7, code::ERROR_XOR)]),
        (b"\x00\xFB\xFB\xFE\x7A\x05noise".to_vec(), vec![]),
        (b"\xFA\xFA\xFA\x02\x02".to_vec(), vec![]),
        ([&b"\xFA\x01\x02\x03"[..], &good].concat(), vec![(9, 0xFF)]),
        ([&good[..], b"between", &good].concat(), vec![(9, 0xFF), (9, 0xFF)]),
        ([&b"\xFA\x01\xFE"[..], &good, b"\xFB\xFB"].concat(), vec![(9, 0xFF)]),
    ]
}

/// Everything that could have been changed.
async fn state(client: &mut Client) -> Vec<Vec<u8>> {
    let mut state = vec![client.command(0x37, 0).await.data().to_vec()];
    for packet_type in [7, 8, 9, 10, 12] {
        state.push(client.ask(packet_type, &[]).await.data().to_vec());
    }
    state.push(client.command(0x0B, 0).await.data().to_vec());
    state
}

#[tokio::test]
async fn packets_that_are_wrong_are_answered_and_change_nothing() {
    let (usb, standard) = (Bench::awake(USB).await, Bench::awake(STANDARD).await);
    let clients = [
        (usb.logged_in().await, 26),
        (usb.log_in(usb.usb_tcp().await).await, 26),
        (standard.log_in(standard.standard().await).await, 25),
    ];
    for (mut client, lan_size) in clients {
        let before = state(&mut client).await;
        for (packet, code) in wrong_packets(lan_size) {
            let bytes = client.framed(&packet);
            client.send(&bytes).await;
            let reply = client.reply().await;
            assert_eq!((reply.packet_type(), reply.id(), reply.code()), (1, 7, code), "{packet:02X?}");
        }
        assert_eq!(state(&mut client).await, before);
    }
}

#[tokio::test]
async fn frames_that_are_wrong_never_hide_the_next_good_one() {
    let bench = Bench::awake(USB).await;
    for mut client in [bench.logged_in().await, bench.log_in(bench.usb_tcp().await).await] {
        let before = state(&mut client).await;
        for (bytes, answers) in wrong_frames() {
            client.send(&bytes).await;
            for (id, code) in answers {
                let reply = client.reply().await;
                let got = if reply.packet_type() == 16 { 0xFF } else { reply.code() };
                assert_eq!((reply.id(), got), (id, code), "{bytes:02X?}");
            }
            // Nothing else is answered, and this is.
            assert_eq!(client.ask(16, &[]).await.packet_type(), 16, "{bytes:02X?}");
        }
        assert_eq!(state(&mut client).await, before);
    }
}

#[tokio::test]
async fn what_is_wrong_with_a_packet_as_such_is_told_to_strangers_too() {
    let bench = Bench::awake(USB).await;
    let mut client = bench.serial();
    for (bytes, code) in [
        (b"\xFA\xFB".to_vec(), code::ERROR_LEN),
        (b"\xFA\x00\x02\x0E\x07\x00\x00\xFB".to_vec(), code::ERROR_XOR),
        (stuffed(&packet(15, 7, &[])), code::ERROR_ACCESS),
        (stuffed(&packet(2, 7, &[1])), code::ERROR_ACCESS),
    ] {
        client.send(&bytes).await;
        assert_eq!(client.reply().await.code(), code, "{bytes:02X?}");
    }
}

#[tokio::test]
async fn version_1_does_not_know_the_newer_instructions() {
    let rig = format!("{USB}    protocol_version = 1\n");
    let bench = Bench::awake(&rig).await;
    let mut client = bench.logged_in().await;
    for opcode in 0x3A..=0x3E {
        let reply = client.command(opcode, 100).await;
        assert_eq!((reply.0[1], reply.code()), (1, code::ERROR_NO_COMMAND), "{opcode:02X}");
    }
    assert_eq!(client.command(0x39, 0).await.code(), code::OK);
}
