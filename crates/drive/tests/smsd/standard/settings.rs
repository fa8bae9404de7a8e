//! LAN parameters, the password and versions.

use super::Port;
use crate::bench::{PASSWORD, SECOND, config};
use stepdrive_drive::smsd::{Config, Event, Record, Session};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, Firmware, LanParameters, Reply, Request, VERSION_1, Versions};

const LAN: LanParameters = LanParameters {
    mac: [2, 4, 6, 8, 10, 12],
    ip: [10, 0, 0, 255],
    subnet_mask: [255, 255, 255, 0],
    gateway: [10, 0, 0, 1],
    dns: [9, 9, 9, 9],
    port: 6000,
    dhcp: 2,
    id: Some(17),
};

fn standard_firmware() -> Port {
    Port::with(Config { firmware: Firmware::Standard, port: 5000, ..config(Model::Smsd42) })
}

fn octets<const N: usize>(port: &mut Port, reg: Reg) -> [i64; N] {
    core::array::from_fn(|index| port.bench.read_nth(reg, u16::try_from(index).expect("small")))
}

#[test]
fn the_factory_parameters_are_those_of_chapter_6_with_the_port_of_the_rig() {
    let factory = LanParameters {
        mac: [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00],
        ip: [192, 168, 1, 2],
        subnet_mask: [255, 255, 0, 0],
        gateway: [192, 168, 1, 1],
        dns: [0, 0, 0, 0],
        port: 5020,
        dhcp: 1,
        id: Some(1),
    };
    assert_eq!(Port::new().lan(), factory);
    assert_eq!(standard_firmware().lan(), LanParameters { port: 5000, id: None, ..factory });
}

#[test]
fn parameters_set_here_are_stored_in_effect_and_read_by_modbus() {
    let mut port = Port::new();
    assert_eq!(port.code(&Request::SetLan(LAN)), Code::Ok);
    assert_eq!(port.bench.drive.poll_event(), Some(Event::NetworkConfigured));
    assert_eq!(port.bench.drive.poll_event(), None);
    assert_eq!(port.bench.drive.take_unsaved(), Some(Record::Lan));
    assert_eq!((port.bench.drive.unit(), port.bench.drive.memory().lan.port), (17, Some(6000)));
    assert_eq!(port.lan(), LAN);
    assert_eq!(octets(&mut port, Reg::LanMac), [2, 4, 6, 8, 10, 12]);
    assert_eq!(octets(&mut port, Reg::LanIp), [10, 0, 0, 255]);
    assert_eq!(octets(&mut port, Reg::LanSubnetMask), [255, 255, 255, 0]);
    assert_eq!(octets(&mut port, Reg::LanGateway), [10, 0, 0, 1]);
    assert_eq!(octets(&mut port, Reg::LanDns), [9, 9, 9, 9]);
    let numbers = [Reg::LanId, Reg::LanPort, Reg::LanDhcp].map(|reg| port.bench.read(reg));
    assert_eq!(numbers, [17, 6000, 2]);
}

#[test]
fn parameters_set_by_modbus_are_answered_once_they_are_in_effect() {
    let mut port = Port::new();
    let before = port.lan();
    port.bench.write(Reg::LanId, 9);
    port.bench.write(Reg::LanPort, 7000);
    assert_eq!(port.lan(), before);
    port.bench.trigger(Reg::ApplyNetworkConfiguration);
    assert_eq!(port.lan(), LanParameters { id: Some(9), port: 7000, ..before });
}

#[test]
fn the_standard_firmware_keeps_the_unit_identifier() {
    let mut port = standard_firmware();
    assert_eq!(port.code(&Request::SetLan(LanParameters { id: None, ..LAN })), Code::Ok);
    assert_eq!(port.lan(), LanParameters { id: None, ..LAN });
    assert_eq!(port.bench.drive.unit(), 1);
}

#[test]
fn the_port_of_the_rig_set_again_is_no_choice() {
    let mut port = Port::new();
    assert_eq!(port.code(&Request::SetLan(LanParameters { port: 5020, ..LAN })), Code::Ok);
    assert_eq!(port.bench.drive.memory().lan.port, None);
}

#[test]
fn a_value_out_of_range_changes_nothing() {
    let mut port = Port::new();
    for wrong in [
        LanParameters { dhcp: 0, ..LAN },
        LanParameters { dhcp: 3, ..LAN },
        LanParameters { port: 0, ..LAN },
        LanParameters { id: Some(0), ..LAN },
        LanParameters { id: Some(248), ..LAN },
    ] {
        port.assert_refused(&Request::SetLan(wrong), Code::ErrorRange);
    }
    for right in [
        LanParameters { dhcp: 1, port: 1, id: Some(1), ip: [0; 4], ..LAN },
        LanParameters { dhcp: 2, port: 65_535, id: Some(247), mac: [255; 6], ..LAN },
    ] {
        assert_eq!(port.code(&Request::SetLan(right)), Code::Ok);
        assert_eq!(port.lan(), right);
    }
}

#[test]
fn a_new_password_is_stored_and_counts_for_modbus_too() {
    let mut port = Port::new();
    assert_eq!(port.code(&Request::SetPassword(0xFEED)), Code::Ok);
    assert_eq!(port.bench.drive.take_unsaved(), Some(Record::Password));
    assert_eq!(port.bench.drive.memory().password, 0xFEED);
    assert!(port.bench.session.is_authorised() && port.session.is_authorised());
    port.bench.session = Session::new();
    assert!(port.bench.log_in(0xFEED));
    assert!(!port.bench.log_in(PASSWORD));
}

#[test]
fn a_password_changed_by_modbus_counts_here() {
    let mut port = Port::new();
    port.bench.enter(0xFEED, 1).expect("authorised");
    port.bench.run_for(SECOND);
    assert_eq!(port.code(&Request::Authorise(0xFEED)), Code::OkAccess);
}

#[test]
fn versions_are_those_of_the_register_map_and_the_protocol() {
    for (model, hardware) in [(Model::Smsd42, 6), (Model::Smsd80, 7)] {
        for protocol in [1, 2] {
            let mut port = Port::with(Config { protocol_version: protocol, ..config(model) });
            let versions = Versions { hardware: [hardware, 1], firmware: [1, 3], protocol };
            assert_eq!(port.reply(&Request::GetVersions), Reply::Versions(versions));
            assert_eq!(port.bench.drive.protocol_version(), protocol);
        }
    }
    let old = Port::with(Config { protocol_version: VERSION_1, ..config(Model::Smsd42) });
    assert_eq!(old.bench.drive.firmware(), Firmware::Modbus);
}
