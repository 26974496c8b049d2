"""`heatrun view`: the live view in the browser."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from . import words
from .exit_codes import DONE


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
    parser.add_argument("--port", type=int, default=5006, help="0 takes a free one")
    parser.add_argument(
        "--address",
        default="127.0.0.1",
        help="network address; the default is reachable from this machine alone, any other by "
        "everyone who can reach it: there is no password",
    )
    parser.add_argument("--no-browser", action="store_true", help="open no window")
    parser.add_argument(
        "--max-file-MB", type=int, default=1000, metavar="MB", help="largest file that is opened"
    )
    parser.add_argument(
        "--max-upload-MB", type=int, default=200, metavar="MB", help="sum of uploads of a page"
    )
    words.add_out(parser, "folder of the runs (default: results/runs)")
    parser.set_defaults(handles_interrupt=True)
    return parser


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from ..errors import InputError

    try:
        from ..app.server import make_server
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
        max_file_bytes=options.max_file_MB * 1_000_000,
        max_upload_bytes=options.max_upload_MB * 1_000_000,
    )
    url = f"http://{options.address}:{server.port}/"
    print(f"heatrun view: {url} shows {options.folder.resolve()}. Ctrl-C ends it.", file=sys.stderr)
    server.start()
    if not options.no_browser:
        server.io_loop.add_callback(server.show, "/")
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        server.stop()
    return DONE
