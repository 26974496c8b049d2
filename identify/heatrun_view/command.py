"""`heatrun view`: the live view in the browser."""

from __future__ import annotations

import argparse
import signal
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatrun.commands import words
from heatrun.commands.console import DONE

if TYPE_CHECKING:
    from .serving import ViewServer


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("view", help="the live view in the browser")
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="folder of tests and motor files (default: here); nothing else can be opened",
    )
    parser.add_argument("--port", type=int, default=5006, help="default: 5006; 0 takes a free one")
    parser.add_argument(
        "--address",
        default="127.0.0.1",
        help="network address; the default is reachable from this machine alone, any other asks "
        "for the token in the address that is printed",
    )
    parser.add_argument(
        "--token",
        action="store_true",
        help="ask for the token at the default address too, where others use this machine",
    )
    parser.add_argument("--no-browser", action="store_true", help="open no window")
    parser.add_argument(
        "--max-file-MB",
        type=int,
        default=1000,
        metavar="MB",
        help="largest file that is opened (default: 1000)",
    )
    parser.add_argument(
        "--max-upload-MB",
        type=int,
        default=200,
        metavar="MB",
        help="sum of all uploads (default: 200)",
    )
    words.add(parser, "--out: folder of the runs (default: results/runs)")
    parser.set_defaults(handles_interrupt=True)
    return parser


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C, SIGTERM or SIGHUP."""
    from heatrun.errors import InputError

    try:
        from .serving import make_server
    except ImportError as error:
        raise InputError(
            f"The live view needs packages that are not installed ({error.name}).",
            remedy="Install them: pip install 'heatrun[app]'.",
        ) from error

    server = make_server(
        options.folder,
        options.out or Path("results") / "runs",
        port=options.port,
        address=options.address,
        asks_token=options.token,
        max_file_bytes=options.max_file_MB * 1_000_000,
        max_upload_bytes=options.max_upload_MB * 1_000_000,
    )
    try:
        _end_by_signals(server.loop)
        _say(server, options.folder.resolve())
        if not options.no_browser:
            server.loop.add_callback(webbrowser.open, server.url, 2)
        server.run()
    finally:
        server.close()
    return DONE


def _say(server: ViewServer, folder: Path) -> None:
    """Print the address, and the warning that goes with an address that others can reach."""
    print(f"heatrun view: {server.url} shows {folder}. Ctrl-C ends it.", file=sys.stderr)
    if not server.is_loopback:
        print(
            "heatrun view: warning: everyone in the network who has this address with its token "
            "can read the folder and start commands; the connection is not encrypted.",
            file=sys.stderr,
        )


def _end_by_signals(loop: Any) -> None:
    """Let Ctrl-C, a kill and the end of the terminal end the loop, and what follows tidy up."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # nohup hands SIGHUP down as ignored, so that a server outlives its terminal
        if number is None or (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
            continue
        signal.signal(number, lambda *_: loop.add_callback_from_signal(loop.stop))
