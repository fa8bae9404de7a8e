//! Lines however they come, over both transports.

use crate::bench::{Bench, IDLE};

/// What a line that is too long is answered.
const TOO_LONG: &str = "0x0040,0x0000,-101 (Argument type)";
/// What a line that means nothing is answered.
const UNKNOWN: &str = "0x0040,0x0000,-4 (Unknown command)";

#[tokio::test]
async fn every_line_is_answered_with_the_flags_and_what_was_set_or_asked_for() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        assert_eq!(client.ask("SER").await, format!("{IDLE},20168-001"));
        assert_eq!(client.ask("MODE,2").await, format!("{IDLE},2 (Remote)"));
        assert_eq!(client.ask(" l+ ,\t1 ").await, format!("{IDLE},1"));
        assert_eq!(client.ask("STOP").await, IDLE);
        assert_eq!(client.ask("").await, IDLE);
        assert_eq!(client.ask("VMAX,0").await, format!("{IDLE},-2 (Argument validation)"));
        assert_eq!(client.ask("RUNV").await, format!("{IDLE},-3 (Unable to get)"));
        assert_eq!(client.ask("SER,1").await, format!("{IDLE},-102 (Argument count)"));
    }
}

#[tokio::test]
async fn lines_cut_anywhere_are_whole_again() {
    let bench = Bench::start().await;
    let text = b"BAKET,77\r\n\r\nser\r\n";
    for mut client in bench.both().await {
        for cut in 1..text.len() {
            client.send(&text[..cut]).await;
            tokio::task::yield_now().await;
            client.send(&text[cut..]).await;
            for expected in [",77", "", ",20168-001"] {
                assert_eq!(client.reply().await, format!("{IDLE}{expected}"), "cut at {cut}");
            }
        }
        for byte in text {
            client.send([*byte]).await;
            tokio::task::yield_now().await;
        }
        assert_eq!(client.reply().await, format!("{IDLE},77"));
        assert_eq!(client.reply().await, IDLE);
        assert_eq!(client.reply().await, format!("{IDLE},20168-001"));
    }
}

#[tokio::test]
async fn cr_lf_cr_and_lf_each_end_a_line() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        client.send("BAKET,1\r\nBAKET,2\rBAKET,3\nBAKET,4\n\rBAKET,5\r\n").await;
        for expected in [",1", ",2", ",3", ",4", "", ",5"] {
            assert_eq!(client.reply().await, format!("{IDLE}{expected}"));
        }
    }
}

#[tokio::test]
async fn a_line_feed_that_comes_after_the_reply_to_its_cr_is_no_line_of_its_own() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        client.send("BAKET,1\r").await;
        assert_eq!(client.reply().await, format!("{IDLE},1"));
        client.send("\n").await;
        assert_eq!(client.ask("BAKET,2").await, format!("{IDLE},2"));
    }
}

#[tokio::test]
async fn a_line_of_257_bytes_is_refused_and_the_next_is_answered() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        let padding = |length: usize| " ".repeat(length - "BAKET".len());
        client.send("BAKET,7\r\n").await;
        assert_eq!(client.reply().await, format!("{IDLE},7"));
        assert_eq!(client.ask(&format!("BAKET{}", padding(256))).await, format!("{IDLE},7"));
        assert_eq!(client.ask(&format!("BAKET{}", padding(257))).await, TOO_LONG);
        assert_eq!(client.ask("BAKET").await, format!("{IDLE},7"));
    }
}

#[tokio::test]
async fn an_endless_line_is_one_line() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        for _ in 0..1000 {
            client.send([b'A'; 1000]).await;
        }
        assert_eq!(client.ask("").await, TOO_LONG);
        assert_eq!(client.ask("BAKET").await, format!("{IDLE},150"));
    }
}

#[tokio::test]
async fn every_byte_that_no_command_has_is_answered_and_does_no_harm() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        for byte in (0..=255).filter(|byte| !matches!(byte, b'\r' | b'\n' | b' ' | b'\t')) {
            client.send([b'V', byte, b'\r', b'\n']).await;
            assert_eq!(client.reply().await, UNKNOWN, "{byte:#04X}");
        }
        client.send(b"BAKET,\xFF\r\n").await;
        assert_eq!(client.reply().await, TOO_LONG);
        assert_eq!(client.ask("BAKET").await, format!("{IDLE},150"));
    }
}

#[tokio::test]
async fn numbers_that_cannot_be_are_refused() {
    let bench = Bench::start().await;
    for mut client in bench.both().await {
        for (argument, error) in [
            ("nan", "-101 (Argument type)"),
            ("inf", "-101 (Argument type)"),
            ("0x", "-101 (Argument type)"),
            ("", "-101 (Argument type)"),
            ("1e999", "-2 (Argument validation)"),
            ("-1", "-2 (Argument validation)"),
        ] {
            assert_eq!(client.data(&format!("VMAX,{argument}")).await, error, "{argument}");
        }
    }
}

#[tokio::test]
async fn garbage_is_answered_line_by_line() {
    let bench = Bench::start().await;
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut noise = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        // Never a terminator, never white space alone, and no mnemonic.
        state.to_le_bytes()[3] | 0x80
    };
    for mut client in bench.both().await {
        for size in 1..256 {
            let mut line: Vec<u8> = (0..size).map(|_| noise()).collect();
            line.extend(b"\r\n");
            client.send(line).await;
            assert_eq!(client.reply().await, UNKNOWN);
        }
    }
}

#[tokio::test]
async fn ten_thousand_commands_sent_without_waiting_are_all_answered_in_order() {
    let bench = Bench::start().await;
    for client in bench.both().await {
        let lines = (0..10_000).map(|number| format!("PREL,{number}\r\n")).collect::<Vec<String>>().concat();
        let replies = client.flood(lines, 10_000).await;
        for (number, reply) in (0_u32..).zip(&replies) {
            let value: f64 = reply.rsplit(',').next().and_then(|value| value.parse().ok()).expect("a number");
            assert!((value - f64::from(number)).abs() < 0.5, "{number}: {reply}");
        }
    }
}
