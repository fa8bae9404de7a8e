//! The behaviour that the drivers share over every line.

pub(crate) mod cancelled;
pub(crate) mod commands;
pub(crate) mod faults;
pub(crate) mod login;
pub(crate) mod programs;
pub(crate) mod properties;
pub(crate) mod registers;
pub(crate) mod settings;

use crate::common::station::MS;
use crate::line::{BenchOf, Line};
use stepdrive_host::Direction;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// A macro that holds a line to all of these tests, in a module of its own.
macro_rules! suite {
    ($dollar:tt $($part:ident: $($test:ident)+;)+) => {
        macro_rules! hold {
            ($dollar name:ident to $dollar line:ty) => {
                mod $dollar name {
                    $(mod $part { $(
                        #[tokio::test(start_paused = true)]
                        async fn $test() { crate::suite::$part::$test::<$dollar line>().await; }
                    )+ })+

                    crate::suite::properties::hold!($dollar line);
                }
            };
        }
        pub(crate) use hold;
    };
}

suite! { $
    login:
        nothing_is_sent_before_something_is_asked
        every_new_connection_is_logged_in
        a_wrong_password_is_told_and_leaves_the_controller_to_others
        a_refused_password_is_tried_again_after_a_while
        a_refused_connection_is_tried_again_with_rising_rests
        a_connection_that_comes_to_no_end_is_given_up
        a_peer_that_closes_every_connection_is_not_asked_in_a_busy_loop
        an_authorisation_that_the_controller_has_forgotten_is_asked_for_again
        a_login_whose_replies_get_lost_is_begun_again
        trouble_while_logging_in_is_no_trouble_of_a_command;
    commands:
        every_command_of_the_table_is_carried_out_once
        what_is_no_command_or_out_of_range_is_not_sent
        every_coil_that_acts_does_so_once
        a_move_ends_where_it_was_to_go
        typed_commands_are_the_codes_of_their_names
        the_four_stops_are_one_request_each
        a_command_that_cannot_be_carried_out_says_why
        a_lost_reply_to_a_command_is_uncertain_and_the_state_is_told
        what_follows_a_lost_command_is_asked_behind_it_on_the_same_connection
        a_command_whose_connection_goes_is_uncertain_whichever_way
        a_state_that_cannot_be_read_is_not_made_up
        a_connection_that_was_closed_while_idle_is_noticed_before_a_command_is_sent;
    faults:
        a_read_survives_every_trouble_with_one_reply
        a_write_survives_every_trouble_with_one_reply
        a_late_reply_is_not_taken_for_the_next_one
        numbers_come_round_and_none_is_taken_for_another
        a_controller_that_never_answers_is_given_up_in_time
        a_write_that_cannot_be_sent_again_may_still_have_arrived
        a_write_that_is_never_answered_says_that_nobody_knows
        power_that_goes_and_comes_back_is_followed
        power_that_goes_and_comes_back_behind_an_open_port_is_followed
        many_tasks_share_one_client_through_trouble;
    cancelled:
        the_reply_to_a_dropped_request_is_thrown_away
        a_dropped_login_is_begun_again
        a_connection_that_is_dropped_while_it_is_opened_is_opened_anew
        a_command_that_had_not_begun_to_go_out_never_does
        a_command_that_has_gone_out_in_part_is_not_finished_late
        a_command_that_has_gone_out_is_carried_out_once
        a_dropped_move_has_happened_once_or_not_at_all
        a_dropped_store_leaves_the_next_one_whole
        a_dropped_change_of_password_is_found_out_at_the_next_login;
    programs:
        programs_of_every_length_are_stored_verified_and_fetched
        progress_is_told_to_twice_the_length
        a_program_that_runs_is_neither_replaced_nor_erased
        what_cannot_be_stored_is_told_and_nothing_is_sent
        a_program_arrives_whole_through_every_trouble_with_one_request
        two_stores_at_once_do_not_mix;
    registers:
        every_register_that_can_be_read_reads_as_what_the_controller_says
        what_cannot_be_read_or_tells_nothing_says_why
        many_registers_are_read_in_few_requests_and_told_in_the_order_asked
        the_whole_map_is_read_in_few_requests
        every_register_that_holds_a_value_takes_its_lowest_and_highest
        a_value_out_of_range_is_told_and_nothing_is_sent
        a_range_that_depends_on_the_model_is_that_of_the_model
        many_values_are_checked_together_and_written_in_few_requests
        few_requests_tell_what_the_motor_does
        few_requests_tell_the_whole_state
        a_register_written_by_hand_may_act_as_well;
    settings:
        a_motor_configuration_is_set_as_a_whole
        lan_parameters_are_stored_and_in_effect
        lan_parameters_out_of_range_are_told
        a_changed_password_counts_from_the_next_connection_on
        a_change_of_password_that_is_not_answered_is_settled_by_logging_in
        a_client_that_does_not_know_which_password_is_in_force_tries_both;
}

pub(crate) fn line(opcode: Opcode, operand: i32) -> Instruction {
    Instruction::with_position(opcode, operand)
}

/// A program of so many instructions, each another. Their words have all bytes that are stuffed among them.
pub(crate) fn program(lines: i32) -> Vec<Instruction> {
    (0..lines).map(|number| line(Opcode::MoveF, number * 1001 - 70_000)).collect()
}

/// The words of a program, as the controller holds them.
pub(crate) fn words(program: &[Instruction]) -> Vec<u32> {
    program.iter().map(|line| line.word()).collect()
}

/// A controller with something in every corner of it, turning.
pub(crate) async fn turning<L: Line>(bench: BenchOf<L>) -> BenchOf<L> {
    let bench = bench.logged_in().await;
    L::fill(&bench).await;
    bench.client.write(Reg::MaxSpeed, 700).await.expect("in range");
    bench.client.set_relay(true).await.expect("a relay");
    bench.change(|drive, now| drive.set_input(now, Input::In1, true));
    bench.client.run(Direction::Negative, 300).await.expect("ready");
    tokio::time::sleep(1234 * MS).await;
    bench
}
