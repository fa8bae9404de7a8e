//! LAN parameters (ch. 6, sheet §9): read and written in one packet, and in effect as soon as they are written.

use super::client::SmsdUsbClient;
use super::registers::{can_be, in_words};
use super::table::{Octets, Place, Sink, source};
use super::trouble::Asked;
use crate::Error;
use crate::smsd::network::{FROM_SERVER, LanParameters, STATIC, differ, out_of_range};
use crate::smsd::snapshot::between;
use crate::smsd::value::Slot;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{self, Request};

impl SmsdUsbClient {
    /// The LAN parameters.
    pub(super) async fn lan_now(&self) -> Result<LanParameters, Error> {
        let mut lan = self.lan().await?;
        if let Some((slot, value)) = values(&mut lan).into_iter().find(|(slot, value)| !can_be(*slot, *value))
        {
            return Err(out_of_range(&slot, value, &self.called().await));
        }
        Ok(typed(&lan))
    }

    /// Sets the LAN parameters, which are stored and in effect at once, and reads them back where that does not change
    /// where the controller is.
    pub(super) async fn set_lan(&self, lan: &LanParameters) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        let mut wanted = packed(lan);
        self.check_all(&values(&mut wanted)).await?;
        let before = self.lan().await?;
        self.check_id(wanted.id, before).await?;
        wanted.id = wanted.id.or(before.id);
        self.put_lan(wanted, &Asked::write_all("the LAN parameters")).await?;
        if self.session.lock().await.is_over_lan() {
            return Ok(());
        }
        let found = self.lan().await?;
        if found == wanted {
            return Ok(());
        }
        Err(differ(&typed(&wanted), &typed(&found)))
    }

    /// Changes some of the LAN parameters.
    pub(super) async fn write_lan(&self, values: &[(Slot, i64)]) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        let mut lan = self.lan().await?;
        for (slot, value) in values {
            let Ok((_, Place::Lan(of))) = source(slot.row.id) else { continue };
            match of(&mut lan, slot.index.into()) {
                Some(octets) => octets.set(*value),
                None => return Err(self.has_none(*slot).await),
            }
        }
        let asked = Asked::write_all(&in_words(values, |sink| matches!(sink, Sink::Lan)));
        self.put_lan(lan, &asked).await
    }

    async fn put_lan(&self, lan: standard::LanParameters, asked: &Asked) -> Result<(), Error> {
        self.told(&Request::SetLan(lan), asked).await?;
        self.leave_lan().await;
        Ok(())
    }

    /// The controller has new LAN parameters: over LAN it ends the connection.
    pub(super) async fn leave_lan(&self) {
        let mut session = self.session.lock().await;
        if session.is_over_lan() {
            session.wire.close();
        }
    }

    async fn check_id(&self, wanted: Option<u8>, before: standard::LanParameters) -> Result<(), Error> {
        if wanted.is_some() && before.id.is_none() {
            return Err(self.has_none(Slot::new(Reg::LanId, 0)?).await);
        }
        Ok(())
    }
}

/// The parameters by their registers.
fn values(lan: &mut standard::LanParameters) -> Vec<(Slot, i64)> {
    let mut all = Vec::new();
    for slot in between(Reg::LanId, Reg::LanDhcp) {
        let Ok((_, Place::Lan(of))) = source(slot.row.id) else { continue };
        all.extend(of(lan, slot.index.into()).as_ref().map(Octets::get).map(|value| (slot, value)));
    }
    all
}

/// As people have them. The parameters are in range.
fn typed(lan: &standard::LanParameters) -> LanParameters {
    let standard::LanParameters { mac, ip, subnet_mask, gateway, dns, port, dhcp, id } = *lan;
    LanParameters { id, mac, ip, subnet_mask, gateway, dns, port, dhcp: dhcp == FROM_SERVER }
}

/// As the packet has them.
fn packed(lan: &LanParameters) -> standard::LanParameters {
    let LanParameters { id, mac, ip, subnet_mask, gateway, dns, port, dhcp } = *lan;
    let dhcp = if dhcp { FROM_SERVER } else { STATIC };
    standard::LanParameters { mac, ip, subnet_mask, gateway, dns, port, dhcp, id }
}
