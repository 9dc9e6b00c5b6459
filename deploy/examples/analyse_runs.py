#!/usr/bin/env python3
"""Lists the newest runs of a flamefield installation, downloads the best one and looks into its volume.

    python3 analyse_runs.py [--url http://127.0.0.1:8080] [--solver hessian] [--burst 10 --token-file DATA/run/web-token]

Needs requests, h5py and numpy (Debian: python3-requests python3-h5py python3-numpy). The API is described at
URL/api/v1/openapi.json.
"""
import argparse
import io
import sys
import time

import h5py
import numpy as np
import requests


class Flamefield:
    def __init__(self, url, token=None):
        self.url = url.rstrip("/")
        self.session = requests.Session()
        if token:
            self.session.headers["Authorization"] = f"Bearer {token}"

    def ask(self, method, path, **options):
        answer = self.session.request(method, f"{self.url}/api/v1/{path}", timeout=60, **options)
        if not answer.ok:
            sys.exit(f"{path}: {answer.json().get('error', answer.reason)}")
        return answer.json()

    def runs(self, **query):
        """All runs that fit, page by page, without holding more than one page."""
        offset = 0
        while True:
            page = self.ask("GET", "runs", params={**query, "offset": offset, "limit": 500})
            yield from page["runs"]
            offset += len(page["runs"])
            if not page["runs"] or offset >= page["total"]:
                return

    def burst(self, pulses):
        """Records a burst and waits until each of its sets is a volume or has failed. Needs the token."""
        capture = self.ask("POST", "capture", json={"kind": "burst", "pulses": pulses})["capture"]
        while True:
            time.sleep(0.5)
            status = self.ask("GET", "status")
            if status["array"]["phase"] == "idle" and status["counters"]["queued"] == 0:
                return self.ask("GET", f"captures/{capture}/receipt")

    def volume(self, run_id):
        """Emission as an array (nz, ny, nx), with spacing and origin in mm."""
        path = self.ask("GET", f"runs/{run_id}")["volume"]
        answer = self.session.get(f"{self.url}/{path}", timeout=600)
        answer.raise_for_status()
        with h5py.File(io.BytesIO(answer.content), "r") as file:
            grid = file["VTKHDF"]
            return grid["PointData/emission"][...], grid.attrs["Spacing"], grid.attrs["Origin"]


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--url", default="http://127.0.0.1:8080")
    options.add_argument("--solver", default="")
    options.add_argument("--burst", type=int, default=0, help="record so many pulses first")
    options.add_argument("--token-file", help="DATA/run/web-token; commands need it")
    options = options.parse_args()
    token = open(options.token_file).read().strip() if options.token_file else None
    lab = Flamefield(options.url, token)

    if options.burst:
        receipt = lab.burst(options.burst)
        print(f"{receipt['capture']}: {receipt['pulses']} pulses, {receipt['sets']} sets, {receipt['volumes']} volumes")
    best = min(lab.runs(solver=options.solver), key=lambda run: run["residual"], default=None)
    if best is None:
        sys.exit("no runs yet (a burst with a rig makes them) see --burst")
    emission, spacing_mm, origin_mm = lab.volume(best["id"])
    print(f"{best['id']}: residual {best['residual']:.4f}, {emission.shape[::-1]} voxels of {spacing_mm[0]:.3g} mm")
    by_height = emission.mean(axis=(0, 2))
    height_mm = origin_mm[1] + spacing_mm[1] * np.arange(len(by_height))
    print(f"brightest at {height_mm[by_height.argmax()]:.1f} mm above the burner, "
          f"centre of emission at {np.average(height_mm, weights=np.maximum(by_height, 0)):.1f} mm")


if __name__ == "__main__":
    main()
