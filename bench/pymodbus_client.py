"""Clients of pymodbus, as a yardstick: one request after another for as long as an order says."""

import asyncio
import sys
import time

from pymodbus.client import AsyncModbusTcpClient, ModbusTcpClient


def check(reply):
    if reply.isError():
        raise SystemExit(str(reply))


def plain(host, port, _, login, read):
    client = ModbusTcpClient(host, port=port)
    client.connect()
    check(client.write_registers(*login))

    def work(seconds):
        count, end = 0, time.monotonic() + seconds
        while time.monotonic() < end:
            check(client.read_input_registers(read[0], count=read[1]))
            count += 1
        return count

    return work


def with_asyncio(host, port, connections, login, read):
    loop = asyncio.new_event_loop()

    async def connect():
        client = AsyncModbusTcpClient(host, port=port)
        await client.connect()
        check(await client.write_registers(*login))
        return client

    async def poll(client, end):
        count = 0
        while time.monotonic() < end:
            check(await client.read_input_registers(read[0], count=read[1]))
            count += 1
        return count

    async def work(seconds):
        end = time.monotonic() + seconds
        return sum(await asyncio.gather(*(poll(client, end) for client in clients)))

    clients = [loop.run_until_complete(connect()) for _ in range(connections)]
    return lambda seconds: loop.run_until_complete(work(seconds))


def main(kind, place, connections, first, count, login, *words):
    host, port = place.rsplit(":", 1)
    start = {"plain": plain, "asyncio": with_asyncio}[kind]
    login = (int(login), [int(word) for word in words])
    work = start(host, int(port), int(connections), login, (int(first), int(count)))
    print("ready", flush=True)
    for order in sys.stdin:
        print(work(int(order) / 1000), flush=True)


main(*sys.argv[1:])
