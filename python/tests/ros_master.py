"""A port for a rosmaster of a test's own, and that it answers there."""

import socket
import time
import xmlrpc.client


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def wait_for_master(uri):
    for _ in range(300):
        try:
            return xmlrpc.client.ServerProxy(uri).getPid("/test")
        except OSError:
            time.sleep(0.1)
    raise TimeoutError("rosmaster does not answer within 30 s")
