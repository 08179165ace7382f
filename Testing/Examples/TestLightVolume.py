# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""light-volume end to end: a hollow sphere of 32^3 voxels, written here as oblique NIfTI, is lit
from inside; every output is read back by other means and checked. Then what must be refused."""

import argparse
import gzip
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import unittest

parser = argparse.ArgumentParser()
parser.add_argument("--program", required=True)
parser.add_argument("--temporary", required=True)
parser.add_argument("--picture", action="store_true", help="OpenGL works here")
ARGUMENTS, REST = parser.parse_known_args()

N = 32
INNER, OUTER = 9.0, 12.0  # voxels: the cavity's radius and the shell's
C, S = math.cos(math.radians(30)), 0.5
# Columns of 1.5, 2 and 2.5 mm, turned by 30 degrees about z and mirrored (left-handed).
AFFINE = [-1.5 * C, -2 * S, 0, 20, -1.5 * S, 2 * C, 0, -30, 0, 0, 2.5, 40]
VOXEL = 1.5 * 2 * 2.5  # mm^3


def world(i, j, k):
    return [AFFINE[4 * r] * i + AFFINE[4 * r + 1] * j + AFFINE[4 * r + 2] * k + AFFINE[4 * r + 3]
            for r in range(3)]


def nifti(values, affine=AFFINE, dims=(N, N, N)):
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *dims, 1, 1, 1, 1)
    struct.pack_into("<hh", header, 70, 2, 8)
    struct.pack_into("<8f", header, 76, 1, 1.5, 2, 2.5, 1, 1, 1, 1)
    struct.pack_into("<f", header, 108, 352)
    header[123] = 2
    struct.pack_into("<hh", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, *affine)
    header[344:348] = b"n+1\0"
    return bytes(header) + bytes(values)


def radius(i, j, k):
    return math.dist((i, j, k), (15.5, 15.5, 15.5))


def read_labels(path):
    with gzip.open(path) as file:
        data = file.read()
    affine = struct.unpack_from("<12f", data, 280)
    return struct.unpack_from("<3h", data, 42), affine, data[352:]


class LightVolume(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = os.path.join(ARGUMENTS.temporary, "light-volume")
        shutil.rmtree(cls.folder, ignore_errors=True)
        os.makedirs(cls.folder)
        cls.ball = os.path.join(cls.folder, "ball.nii.gz")
        values = bytearray()
        for k in range(N):
            for j in range(N):
                for i in range(N):
                    r = radius(i, j, k)
                    values.append(100 if r < INNER else 200 if r < OUTER else 20)
        cls.values = values
        with gzip.open(cls.ball, "wb") as file:
            file.write(nifti(values))

    def path(self, name):
        return os.path.join(self.folder, name)

    def run_program(self, *arguments, env=None):
        environment = dict(os.environ, DISPLAY="", **(env or {}))
        done = subprocess.run([ARGUMENTS.program, *arguments], capture_output=True, text=True,
                              env=environment, timeout=200)
        return done.returncode, done.stdout, done.stderr

    def refuse(self, *arguments, words=(), out="refused"):
        code, stdout, stderr = self.run_program(*arguments, "--out", self.path(out))
        self.assertEqual(code, 1, stdout + stderr)
        lines = stderr.strip().split("\n")
        self.assertEqual(len(lines), 1, stderr)
        self.assertTrue(lines[0].startswith("light-volume: error: "), stderr)
        for word in words:
            self.assertIn(word, stderr)
        if os.path.isdir(self.path(out)):
            self.assertEqual(os.listdir(self.path(out)), [])
        return stderr

    def test_end_to_end(self):
        out = self.path("out")
        seed = world(15, 16, 17)
        pictures = ["--pictures", "plain,lit,slices,flux,arrows", "--size", "200x160"]
        code, stdout, stderr = self.run_program(
            self.ball, "--out", out, "--seed", ",".join(map(str, seed)) + ",3,2",
            "--mapping", "transfer", "--diffusion-tf", "90:0,99:1,101:1,110:0", "--reach", "100",
            "--threshold", "1e-4", "--title", 'a "ball"',
            *(pictures if ARGUMENTS.picture else ["--no-render"]))
        self.assertEqual(code, 0, stdout + stderr)
        self.assertEqual(stderr, "")
        with open(os.path.join(out, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
        expected = ["fluence.vti", "lit.nii.gz", "report.json"]
        if "OpenVDB" in report["versions"]:
            expected.append("fluence.vdb")
        if ARGUMENTS.picture:
            expected += [name + ".png" for name in ("plain", "lit", "slices", "flux", "arrows")]
        self.assertEqual(sorted(os.listdir(out)), sorted(expected))
        self.assertEqual(sorted(report["files"]), sorted(expected))
        self.assertEqual(report["parameters"]["title"], 'a "ball"')
        self.assertEqual(report["parameters"]["mapping"], "transfer")
        self.assertEqual(report["input"]["world"], "RAS")
        for got, want in zip(report["input"]["voxel_to_world"], AFFINE):
            self.assertAlmostEqual(got, want, 4)
        for got, want in zip(report["seeds"][0]["voxel"], (15, 16, 17)):
            self.assertAlmostEqual(got, want, 4)
        solver = report["solver"]
        self.assertEqual(solver["stop_reason"], "Converged")
        self.assertLessEqual(solver["residual"], 1e-8)
        self.assertAlmostEqual(solver["emitted_power"], 2, 5)
        self.assertAlmostEqual(solver["absorbed_power"] + solver["escaped_power"], 2, 5)
        for stage in ("read", "medium", "sources", "solve", "write fluence.vti"):
            self.assertIn(stage, report["seconds"])

        # The labelmap: the input's grid, the cavity alone, its volume.
        dims, affine, labels = read_labels(os.path.join(out, "lit.nii.gz"))
        self.assertEqual(dims, (N, N, N))
        for got, want in zip(affine, AFFINE):
            self.assertAlmostEqual(got, want, 4)
        lit = sum(labels)
        self.assertEqual(report["lit_region"]["voxels"], lit)
        self.assertAlmostEqual(report["lit_region"]["volume"] / VOXEL, lit, 2)
        self.assertAlmostEqual(report["lit_region"]["ml"], lit * VOXEL / 1000, 4)
        cavity = sum(v == 100 for v in self.values)
        inside = sum(l for l, v in zip(labels, self.values) if v == 100)
        self.assertGreater(inside, .98 * cavity)
        self.assertLess(lit, 1.35 * cavity)  # and a skin of one voxel
        for n, label in enumerate(labels):
            if label:
                self.assertLess(radius(n % N, n // N % N, n // N // N), INNER + 2)

    def test_vti_lies_where_the_input_does(self):
        try:
            from vtkmodules.vtkIOXML import vtkXMLImageDataReader
            from vtkmodules.util.numpy_support import vtk_to_numpy
        except ImportError:
            self.skipTest("no vtkmodules")
        out = self.path("vti")
        code, stdout, stderr = self.run_program(
            self.ball, "--out", out, "--seed", "@15,16,17,0", "--files", "vti", "--no-render",
            "--quiet")
        self.assertEqual((code, stdout, stderr), (0, "", ""))
        reader = vtkXMLImageDataReader()
        reader.SetFileName(os.path.join(out, "fluence.vti"))
        reader.Update()
        image = reader.GetOutput()
        fluence = vtk_to_numpy(image.GetPointData().GetArray("Fluence"))
        brightest = image.GetPoint(int(fluence.argmax()))
        for got, want in zip(brightest, world(15, 16, 17)):
            self.assertAlmostEqual(got, want, 3)
        self.assertIsNotNone(image.GetFieldData().GetAbstractArray("LightDiffusionReport.StopReason"))

    def test_coarse_solve_keeps_the_labels_grid(self):
        out = self.path("coarse")
        code, stdout, stderr = self.run_program(
            self.ball, "--out", out, "--seed", "@15,16,17", "--coarsen", "3", "--files", "nii",
            "--no-render")
        self.assertEqual(code, 0, stdout + stderr)
        dims, affine, labels = read_labels(os.path.join(out, "lit.nii.gz"))
        self.assertEqual(dims, (N, N, N))
        for got, want in zip(affine, AFFINE):
            self.assertAlmostEqual(got, want, 4)
        self.assertEqual(labels[15 + N * (16 + N * 17)], 1)
        with open(os.path.join(out, "report.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file)["solver"]["grid"], [11, 11, 11])

    def test_paint_strokes_and_models(self):
        paint = self.path("paint.nii")
        with open(paint, "wb") as file:
            file.write(nifti(bytes(1 if radius(i, j, k) < 2 else 0 for k in range(N)
                                   for j in range(N) for i in range(N))))
        out = self.path("paint")
        common = ["--out", out, "--files", "none", "--no-render"]
        code, stdout, stderr = self.run_program(self.ball, "--paint", paint, *common)
        self.assertEqual(code, 0, stdout + stderr)
        with open(os.path.join(out, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
        painted = sum(radius(i, j, k) < 2 for k in range(N) for j in range(N) for i in range(N))
        self.assertAlmostEqual(report["solver"]["source_power"], painted * VOXEL, 3)
        code, stdout, stderr = self.run_program(
            self.ball, "--stroke", "@12,15,15:@19,15,15:r=1:p=3", *common)
        self.assertEqual(code, 0, stdout + stderr)
        with open(os.path.join(out, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
        self.assertAlmostEqual(report["solver"]["source_power"], 3, 5)
        self.assertNotIn("seeds", report)
        code, stdout, stderr = self.run_program(
            self.ball, "--seed", "@15,15,15", "--model", "anisotropic", "--steps", "5", "--courant",
            "10", *common)
        self.assertEqual(code, 0, stdout + stderr)
        # No seed at all: one is chosen, and said.
        code, stdout, stderr = self.run_program(self.ball, *common)
        self.assertEqual(code, 0, stdout + stderr)
        self.assertIn("no --seed", stdout)

    def test_lit_from_outside_needs_no_solve(self):
        if not ARGUMENTS.picture:
            self.skipTest("no OpenGL")
        out = self.path("outside")
        kinds = ["shaded", "shadows", "environment"]
        for side, light in (("left", "-80,0"), ("right", "80,0")):
            code, stdout, stderr = self.run_program(
                self.ball, "--out", out, "--pictures", ",".join(kinds), "--files", "none",
                "--size", "64x64", "--tf", "50:0,90:1", "--key-light", light,
                "--shadow-strength", "1")
            self.assertEqual((code, stderr), (0, ""), stdout + stderr)
            self.assertNotIn("solve", stdout)
            self.assertEqual(sorted(os.listdir(out)), sorted(kind + ".png" for kind in kinds))
            os.rename(os.path.join(out, "shadows.png"), self.path(f"shadows-{side}.png"))
        pictures = []
        for side in ("left", "right"):
            with open(self.path(f"shadows-{side}.png"), "rb") as file:
                pictures.append(file.read())
        self.assertNotEqual(*pictures)

    def test_what_opengl_cannot_draw_leaves_the_rest(self):
        if not ARGUMENTS.picture:
            self.skipTest("no OpenGL")
        # Longer than any GPU's 3-D texture.
        long = self.path("long.nii")
        dims = (20000, 2, 2)
        with open(long, "wb") as file:
            file.write(nifti(bytes(n % 7 for n in range(80000)), dims=dims))
        out = self.path("long")
        code, stdout, stderr = self.run_program(
            long, "--seed", "@100,1,1", "--out", out, "--size", "64x64", "--files", "nii")
        self.assertEqual(code, 1, stdout + stderr)
        self.assertEqual(len(stderr.strip().split("\n")), 1, stderr)
        self.assertIn("cannot make the picture 'plain'", stderr)
        self.assertEqual(sorted(os.listdir(out)), ["lit.nii.gz", "report.json"])

    def test_options_are_refused_by_name(self):
        ball = self.ball
        self.refuse(ball, "--sede", "1,2,3", words=("--sede", "did you mean --seed?"))
        self.refuse(ball, "--frobnicate", words=("--frobnicate", "--help"))
        self.refuse(ball, "--seed", "1,2", words=("--seed", "'1,2'", "x,y,z"))
        self.refuse(ball, "--seed", "1,2,3,-1", words=("radius",))
        self.refuse(ball, "--seed", "1,2,3,1,nan", words=("--seed", "nan"))
        self.refuse(ball, "--albedo", "1.5", words=("--albedo", "1.5", "0 to 1"))
        self.refuse(ball, "--mapping", "magic", words=("magic", "gradient, transfer or"))
        self.refuse(ball, "--size", "640", words=("--size", "WIDTHxHEIGHT"))
        self.refuse(ball, "--tf", "10:2", words=("--tf", "10:2"))
        self.refuse(ball, "--key-light", "10,95", words=("--key-light", "10,95", "elevation"))
        self.refuse(ball, "--shadow-strength", "2", words=("--shadow-strength", "0 to 1"))
        self.refuse(ball, "--steps", "1.5", words=("--steps", "1.5"))
        self.refuse(ball, "--model", "anisotropic", "--mode", "steady", words=("steady", "constant"))
        self.refuse(ball, ball, words=("two inputs",))
        self.refuse(words=("no input",))

    def test_bad_input_is_refused(self):
        self.refuse(self.ball, "--seed", "@40,3,3", "--no-render",
                    words=("--seed '@40,3,3'", "outside", "(31, 31, 31)", "RAS mm"))
        message = self.refuse(self.ball, "--seed", "500,0,0", "--no-render",
                              words=("'500,0,0'", "outside", "voxel"))
        self.assertIn("within (", message)
        self.refuse(self.path("absent.nii"), words=("absent.nii", "No such file"))
        short = self.path("short.nii")
        with open(short, "wb") as file:
            file.write(nifti(self.values)[:-100])
        self.refuse(short, words=("short.nii", "truncated"))
        empty = self.path("nothing-here")
        os.makedirs(empty, exist_ok=True)
        self.refuse(empty, words=("nothing-here", "DICOM"))
        self.refuse(self.ball, "--paint", self.path("absent.mha"), "--no-render",
                    words=("absent.mha",))
        # A diffusion function beyond 0..1 cannot be given; no absorption with mirrors can.
        self.refuse(self.ball, "--seed", "@15,15,15", "--absorption", "albedo", "--albedo", "1",
                    "--reach", "0", "--boundary", "zeroflux", "--no-render", words=("steady",))

    def test_output_folder_is_tried_first(self):
        blocked = self.path("a-file")
        with open(blocked, "w", encoding="utf-8") as file:
            file.write("in the way\n")
        code, stdout, stderr = self.run_program(self.path("absent.nii"), "--out",
                                                os.path.join(blocked, "below"))
        self.assertEqual((code, stdout), (1, ""))
        self.assertIn("--out", stderr)
        self.assertIn("a-file", stderr)

    def test_help_and_version(self):
        code, stdout, stderr = self.run_program("--help")
        self.assertEqual((code, stderr), (0, ""))
        for option in ("--seed", "--preset", "--reach", "--coarsen", "--version"):
            self.assertIn(option, stdout)
        code, stdout, stderr = self.run_program("--version")
        self.assertEqual((code, stderr), (0, ""))
        self.assertRegex(stdout, r"^light-volume \d+\.\d+\.\d+ \(VTK \d")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *REST])
