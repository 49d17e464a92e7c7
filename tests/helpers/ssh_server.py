"""An SSH server for `HOME=FOLDER` of its clients: `python ssh_server.py FOLDER` prints "ready" and serves.

Every host whose name starts with "node" is this machine. SIGTERM ends the server and all commands.
"""

import asyncio
import os
import signal
import sys
from pathlib import Path

import asyncssh


async def run(process):
    """Run one command; a signal of the client ends it."""
    pipe = asyncio.subprocess.PIPE
    command = await asyncio.create_subprocess_shell(
        process.command,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=pipe,
        stderr=pipe,
        start_new_session=True,
    )
    with (folder / "commands.log").open("a") as log:
        log.write(f"{process.command}\n")
    running.add(command.pid)
    signals = asyncio.create_task(obey_signals(process, command))
    await asyncio.gather(
        copy(command.stdout, process.stdout), copy(command.stderr, process.stderr)
    )
    process.exit(await command.wait())
    running.discard(command.pid)
    signals.cancel()


async def copy(reader, writer):
    """Send what a command prints, line by line, also to a client that has gone."""
    async for line in reader:
        if not writer.is_closing():
            writer.write(line)


async def obey_signals(process, command):
    """End a command at the first signal."""
    try:
        await process.stdin.read()
    except asyncssh.SignalReceived:
        os.killpg(command.pid, signal.SIGTERM)


async def serve():
    """Write the keys and the configuration of the clients, and serve until the end."""
    own, client = (
        asyncssh.generate_private_key("ssh-ed25519"),
        asyncssh.generate_private_key("ssh-ed25519"),
    )
    settings = folder / ".ssh"
    settings.mkdir()
    client.write_private_key(settings / "id_ed25519")
    client.write_public_key(settings / "id_ed25519.pub")
    server = await asyncssh.listen(
        "127.0.0.1",
        0,
        server_host_keys=[own],
        authorized_client_keys=str(settings / "id_ed25519.pub"),
        process_factory=run,
        encoding=None,
    )
    (settings / "known_hosts").write_text(f"* {own.export_public_key().decode()}")
    (settings / "config").write_text(
        f"Host node*\n  HostName 127.0.0.1\n  Port {server.get_port()}\n"
        f"  UserKnownHostsFile {settings}/known_hosts\n  IdentityFile {settings}/id_ed25519\n"
    )
    print("ready", flush=True)
    await server.wait_closed()


if __name__ == "__main__":
    folder, running = Path(sys.argv[1]), set()  # groups of processes
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    try:
        asyncio.run(serve())
    finally:
        for group in running:
            os.killpg(group, signal.SIGKILL)
