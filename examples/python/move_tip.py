"""move_tip.py PAGE U,V [U,V ...]: the tip goes to pixels of the live page of `lapservo servo --web`, at its present depth.

PAGE: the address of the page, as http://127.0.0.1:8080/, on this computer.
"""

import json
import sys
import time
import urllib.error
import urllib.request

if len(sys.argv) < 3:
    sys.exit(__doc__)
page = sys.argv[1].rstrip("/")


def state():
    with urllib.request.urlopen(f"{page}/state") as answer:
        return json.load(answer)


for pixel in sys.argv[2:]:
    u, v = (float(number) for number in pixel.split(","))
    now = state()
    goal = urllib.request.Request(f"{page}/tip?u={u}&v={v}&image={now['images']}&at={now['now_s']}", method="POST",
                                  headers={"Origin": page})
    try:
        urllib.request.urlopen(goal)
    except urllib.error.HTTPError as refusal:
        sys.exit(f"{pixel}: {refusal.read().decode().strip()}")
    end = time.monotonic() + 10
    while (answer := state()["loop"]["answer"]) == now["loop"]["answer"] and time.monotonic() < end:
        time.sleep(0.1)
    print(f"{pixel}: {answer if answer != now['loop']['answer'] else 'no answer'}")
    time.sleep(3)
