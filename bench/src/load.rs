//! A load on servers over loopback, in rounds that alternate between them, so that whatever else the machine does falls
//! on all.
//!
//! The clients are tasks of the process that measures: each connection has one request in flight, in turn FC03 of one
//! register and FC04 of six.

use crate::median;
use crate::requests::{adu, read};
use crate::servers::ServerProcess;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::registers::Reg;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::Instant;

/// How long requests are sent before the first round.
const WARM_UP: Duration = Duration::from_millis(300);
/// The function code's place in a frame.
const FUNCTION: usize = 7;

/// What can be measured in rounds.
pub trait Contestant {
    /// Works for so long.
    ///
    /// # Errors
    /// When it cannot.
    fn round(&mut self, time: Duration) -> impl Future<Output = io::Result<Round>>;
}

/// A server and the connections to it.
#[derive(Debug)]
pub struct Contender {
    name: String,
    server: ServerProcess,
    connections: Vec<TcpStream>,
}

/// What a round gave.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// Requests in a second.
    pub rate: f64,
    /// Processor time of what is measured for a request, in microseconds.
    pub cost: f64,
}

/// What the rounds of each contender gave, in the order in which the contenders were given.
#[derive(Debug)]
pub struct Rounds(Vec<Vec<Round>>);

impl Rounds {
    /// Measures every contestant in turn, `number` times for `time`.
    ///
    /// # Errors
    /// When one cannot work, as when a server does not answer, or answers with an exception.
    pub async fn measure(
        contenders: &mut [impl Contestant],
        number: usize,
        time: Duration,
    ) -> io::Result<Rounds> {
        for contender in contenders.iter_mut() {
            contender.round(WARM_UP).await?;
        }
        let mut rounds: Vec<Vec<Round>> = vec![Vec::new(); contenders.len()];
        for number in 0..number {
            // Every other time the other way round, so that none always comes first.
            let mut order: Vec<usize> = (0..contenders.len()).collect();
            if number % 2 == 1 {
                order.reverse();
            }
            for place in order {
                rounds[place].push(contenders[place].round(time).await?);
            }
        }
        Ok(Rounds(rounds))
    }

    /// The median of a figure of the contender at `place`.
    pub fn figure(&self, place: usize, of: fn(&Round) -> f64) -> f64 {
        median(self.0[place].iter().map(of))
    }

    /// The median of a figure of the contender at `place` to that of the one at `other`, by pairs of rounds.
    pub fn ratio(&self, place: usize, other: usize, of: fn(&Round) -> f64) -> f64 {
        median(self.0[place].iter().zip(&self.0[other]).map(|(this, other)| of(this) / of(other)))
    }
}

impl Contender {
    /// Connects to a server at each of `places`.
    ///
    /// # Errors
    /// When it does not let them.
    pub async fn connect(
        name: impl Into<String>,
        server: ServerProcess,
        places: impl IntoIterator<Item = SocketAddr>,
    ) -> io::Result<Contender> {
        let mut connections = Vec::new();
        for address in places {
            let stream = TcpStream::connect(address).await?;
            stream.set_nodelay(true)?;
            connections.push(stream);
        }
        Ok(Contender { name: name.into(), server, connections })
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The server.
    pub fn server(&self) -> &ServerProcess {
        &self.server
    }

    /// The connections.
    pub fn connections(&mut self) -> &mut [TcpStream] {
        &mut self.connections
    }
}

impl Contestant for Contender {
    /// Sends requests over all connections for so long.
    async fn round(&mut self, time: Duration) -> io::Result<Round> {
        let ended = Arc::new(AtomicBool::new(false));
        let (start, used) = (Instant::now(), self.server.cpu_time()?);
        let clients: Vec<_> = self
            .connections
            .drain(..)
            .map(|stream| tokio::spawn(client(stream, Arc::clone(&ended))))
            .collect();
        tokio::time::sleep(time).await;
        ended.store(true, Ordering::Relaxed);
        let mut requests = 0.0;
        for client in clients {
            let (stream, count) = client.await.map_err(io::Error::other)??;
            self.connections.push(stream);
            requests += f64::from(count);
        }
        let (time, used) = (start.elapsed(), self.server.cpu_time()?.saturating_sub(used));
        Ok(Round { rate: requests / time.as_secs_f64(), cost: used.as_secs_f64() * 1e6 / requests })
    }
}

/// One request after another until told to end; gives their number.
async fn client(mut stream: TcpStream, ended: Arc<AtomicBool>) -> io::Result<(TcpStream, u32)> {
    let requests: [Request; 2] = [read(Reg::MaxSpeed, 1), read(Reg::Speed, 6)];
    let requests = requests.map(|request| adu(&request));
    let mut count = 0;
    for request in requests.iter().cycle() {
        if ended.load(Ordering::Relaxed) {
            break;
        }
        exchange(&mut stream, request).await?;
        count += 1;
    }
    Ok((stream, count))
}

/// Sends a request and waits for the whole reply.
///
/// # Errors
/// When the connection ends, or the reply is an exception.
pub async fn exchange(stream: &mut TcpStream, request: &[u8]) -> io::Result<()> {
    stream.write_all(request).await?;
    let mut reply = [0; 260];
    let mut filled = 0;
    loop {
        let count = stream.read(&mut reply[filled..]).await?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        filled += count;
        if filled > FUNCTION && filled >= 6 + usize::from(reply[5]) {
            break;
        }
    }
    // The echo knows sizes only.
    let function = reply[FUNCTION];
    if function == 0 || function == request[FUNCTION] {
        Ok(())
    } else {
        Err(io::Error::other("an exception"))
    }
}
