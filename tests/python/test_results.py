"""The program of the result pages: what a page says, and that rows come back."""

from bench import results

SCORES = {column: "1.0" for column in results.SCORES}


def row(scene, minutes, asset, relit, **other):
    values = {"scene": scene, "minutes": minutes, "asset": asset, "date": "2026-01-02 10:00"} | SCORES
    values |= {"settings": "cpu", "seed": "0", "images": "9", "threads": "1", "seconds": "3"}
    values |= {"kernels": "avx2", "commit": "abc"}
    return values | {"relit, dB": relit} | other


def test_means_are_over_what_is_delivered():
    rows = [row("knot", "8", "trained", "20.0"), row("knot", "8", "refined", "30.0")]
    rows += [row("rings", "8", "refined", "31.0"), row("rings", "30", "refined", "", **{"albedo, dB": "40.0"})]
    eight, thirty, _ = results.means(rows)
    assert eight.startswith("Mean of 2 runs of 8 minutes: relit 30.5 dB, albedo 1.0 dB")
    assert thirty.startswith("Mean of 1 runs of 30 minutes: albedo 40.0 dB")


def test_scores_are_taken_by_their_keys():
    found = results.scored(
        {"relight": {"psnr": 31.26, "raw": {"psnr": 30.04}}, "normal_mae_deg": None, "seconds": 12.6}
    )
    assert (found["relit, dB"], found["unscaled relit, dB"], found["seconds"]) == ("31.3", "30.0", "13")
    assert found["normals, degrees"] == found["albedo, dB"] == ""


def test_a_page_says_its_rows_and_the_commit_of_the_oldest(monkeypatch, tmp_path):
    rows = [
        row("knot", "30", "refined", "32.5", date="2026-01-03 10:00", commit="def"),
        row("rings", "30", "refined", "29.5", kernels="avx512"),
    ]
    results.write_page(tmp_path, "scenes", rows, tmp_path)
    assert results.read_rows(tmp_path / "scenes.csv") == rows
    text = (tmp_path / "scenes.md").read_text()
    head, lines = text.splitlines()[2], [line for line in text.splitlines() if line.startswith("| ")]
    assert "commit abc" in head and "date 2026-01-02" in head and "avx" not in head  # each row names its kernels
    assert "| knot | 30 |" in lines[2] and " 32.5 " in lines[2] and "avx2" in lines[2] and "avx512" in lines[3]
    assert "Mean of 2 runs of 30 minutes: relit 31.0 dB" in text
