"""What readers do with a page: it works from the file alone, and what it shows stays true."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from conftest import DESK, PHONE

NAMES = ["report", "point", "global"]
FIRST_PAINT_MS, READY_MS = 1000, 2000
LEAST_TEXT_PX = 11

# Texts of figures in pixels as shown; subscripts of formulas are parts of a text, and smaller by design.
TEXT_SIZES = """() => [...document.querySelectorAll('figure svg text')].map(text => {
  const svg = text.ownerSVGElement, scale = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
  const size = parseFloat(getComputedStyle(text).fontSize) * scale;
  return [size, `${text.closest('figure').id}: ${text.textContent}`];
})"""
OVERLAPS = """() => [...document.querySelectorAll('figure svg')].flatMap(svg => {
  const frame = svg.getBoundingClientRect(), found = [], texts = [...svg.querySelectorAll('text')];
  const boxes = texts.map(text => [text.textContent, text.getBoundingClientRect()]);
  boxes.forEach(([text, box], i) => {
    const beside = box.left < frame.left - 1 || box.right > frame.right + 1;
    if (beside || box.top < frame.top - 1 || box.bottom > frame.bottom + 1)
      found.push(`${svg.closest('figure').id}: ${text} leaves the figure`);
    for (const [other, place] of boxes.slice(0, i)) {
      const across = Math.min(box.right, place.right) - Math.max(box.left, place.left);
      const down = Math.min(box.bottom, place.bottom) - Math.max(box.top, place.top);
      if (across > 1 && down > 4) found.push(`${svg.closest('figure').id}: ${text} on ${other}`);
    }
  });
  return found;
})"""


def numbers(column: list[str]) -> list[float]:
    return [float(text) for text in column if text]


@pytest.mark.parametrize("name", NAMES)
def test_a_page_opens_from_its_file_alone_without_a_complaint(visit, pages, name):
    seen = visit(name)
    seen.page.wait_for_timeout(300)
    assert seen.complaints == []
    assert seen.requests == [seen.address]
    text = pages[name].read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href|action)\s*=\s*["']?(?:https?:)?//""", text)
    assert str(pages["report"].resolve().parents[1]) not in text
    assert str(Path.home()) + "/" not in text


@pytest.mark.parametrize("name", NAMES)
def test_every_entry_of_the_contents_leads_to_a_section(visit, name):
    page = visit(name).page
    entries = page.evaluate(
        "[...document.querySelectorAll('nav a')].map(a => a.getAttribute('href').slice(1))"
    )
    assert len(entries) >= 4
    assert page.evaluate("ids => ids.filter(id => !document.getElementById(id))", entries) == []
    assert page.locator("main section:not([id])").count() == 0
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map(element => element.id)")
    assert len(ids) == len(set(ids))


def test_contents_follow_the_scroll(visit):
    page = visit("report").page
    target = page.locator("nav a").nth(3)
    page.evaluate("id => document.getElementById(id).scrollIntoView()", target.get_attribute("href")[1:])
    sync_api = pytest.importorskip("playwright.sync_api")
    sync_api.expect(target).to_have_attribute("aria-current", "true")


def test_the_browser_shows_it_in_a_second_and_lets_it_be_used_in_two(browser, visit):
    paints, ready = [], []
    for _ in range(3):
        page = visit("report").page
        # the page forbids what wait_for_function does between two looks: to evaluate a text
        while not page.evaluate("performance.getEntriesByType('paint').length"):
            page.wait_for_timeout(20)
        paints.append(page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime"))
        ready.append(page.evaluate("performance.getEntriesByName('ready')[0].startTime"))
    assert min(paints) <= FIRST_PAINT_MS, paints
    assert min(ready) <= READY_MS, ready


def test_a_table_is_sorted_by_value_and_comes_back(visit):
    seen = visit("report")
    head = seen.page.locator(f"[id='{seen.conditions}'] thead th").filter(has_text="Condition number")
    original = seen.csv(seen.conditions)
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    up = numbers([row[-1] for row in seen.csv(seen.conditions)[1:]])
    head.get_by_role("button").click()
    down = numbers([row[-1] for row in seen.csv(seen.conditions)[1:]])
    head.get_by_role("button").click()
    assert up == sorted(up)
    assert down == sorted(up, reverse=True)
    assert len(set(up)) > 1
    assert seen.csv(seen.conditions) == original


def test_a_copied_table_holds_numbers_in_full(visit, pages):
    rows = (seen := visit("report")).csv(seen.conditions)
    assert len({len(row) for row in rows}) == 1
    page = pages["report"].read_text(encoding="utf-8")
    digits = [len(re.sub(r"\D", "", cell)) for row in rows[1:] for cell in row]
    assert max(digits) > 10  # the page shows three or four
    assert all(f'value="{row[-1]}"' in page for row in rows[1:])


def test_page_one_says_what_fits_worst_and_where_and_leads_to_the_doubts(visit):
    page = visit("report").page
    findings = page.locator("#verdict > .findings").inner_text()
    assert re.search(r"fits the .* worst: .* It fits worst from [\d.]+ to [\d.]+ Hz", findings)
    count = int(re.search(r"(\d+) of \d+ parameters cannot be read as numbers", findings)[1])
    assert page.locator("table[id$='doubts.1'] tbody tr").count() == count
    page.locator("#verdict > .findings").get_by_role("link", name="Point models").click()
    assert page.locator("#points").evaluate("s => Math.abs(s.getBoundingClientRect().top)") < 200
    for label in page.locator("#verdict > .findings .kind").all_inner_texts()[:3]:
        assert label.lower() in ("yes", "with limits", "no", "open")


def test_margins_of_model_and_simulation_stand_beside_each_other_with_a_reason(visit):
    page = visit("report").page
    table = page.locator("table").filter(has_text="Phase margin under the same control law")
    rows = [r.locator("td").all_inner_texts() for r in table.locator("tbody tr").all()]
    flown = [row for row in rows if re.fullmatch(r"[\d.]+", row[-1])]
    assert len(flown) == 1
    simulation, effect = float(flown[0][-2]), float(flown[0][-1])
    reason = page.locator("#loops ~ p").first.inner_text()
    assert f"is {simulation:.1f} deg in the simulation and {effect:.1f} deg with the effect" in reason


def test_the_doubts_can_be_sorted_filtered_and_printed_whole(visit):
    seen = visit("report")
    page = seen.page
    table = page.locator("table[id$='doubts.1']")
    name = table.get_attribute("id")
    head = table.locator("thead th").filter(has_text="Half interval")
    place = [h.strip() for h in seen.csv(name)[0]].index("Half interval (%)")
    head.get_by_role("button").click()
    up = numbers([row[place] for row in seen.csv(name)[1:]])
    assert up == sorted(up)
    assert len(set(up)) > 5
    rows, box = table.locator("tbody tr").count(), table.locator("..")
    assert box.evaluate("b => b.scrollHeight > b.clientHeight")  # it scrolls on a screen
    page.emulate_media(media="print")
    assert box.evaluate("b => b.scrollHeight <= b.clientHeight + 1")  # and is whole on paper
    page.emulate_media(media="screen")
    page.locator(".filter summary").click()
    page.locator("fieldset input[name=condition]").nth(0).check()
    left = table.locator("tbody tr:not(.filtered)").count()
    assert 0 < left < rows


def test_a_filter_leaves_what_was_asked_for_and_says_so(visit):
    seen = visit("report")
    page = seen.page
    figures = page.locator("main figure")
    every = figures.count()
    conditions = page.locator("fieldset input[name=condition]")
    chosen = conditions.nth(1).get_attribute("value")
    page.locator(".filter summary").click()
    page.get_by_label("M", exact=True).check()
    conditions.nth(1).check()
    shown = page.evaluate(
        "[...document.querySelectorAll('main figure:not(.filtered)')].map(f => ({...f.dataset}))"
    )
    assert 0 < len(shown) < every
    for figure in shown:
        assert "M" in figure.get("response", "M")
        assert chosen in figure.get("condition", chosen)
    rows = page.locator(f"[id='{seen.conditions}'] tbody tr:not(.filtered)")
    assert rows.count() == 1
    assert chosen in rows.first.inner_text()
    heads = page.locator(f"[id='{seen.conditions}'] thead tr").last.locator("th").all()
    visible = [head for head in heads if head.is_visible()]
    assert [head.inner_text() for head in visible] == ["M"]
    assert f"only M at {chosen}" in page.get_by_role("status").inner_text()
    assert page.evaluate("matchMedia('print').matches") is False
    page.emulate_media(media="print")  # what is printed is whole
    assert page.locator(f"[id='{seen.conditions}'] tbody tr").nth(0).is_visible()
    page.emulate_media(media="screen")
    page.get_by_role("button", name="Show all").click()
    assert page.locator(".filtered").count() == 0


@pytest.mark.parametrize("name", NAMES)
def test_units_change_where_numbers_carry_them_and_come_back(visit, name):
    page = visit(name).page
    before = page.locator("main").inner_html()
    page.locator("select[name=units]").select_option("us")
    after = page.locator("main").inner_text()
    assert "ft/s" in after
    assert "The figure is in SI units" in after
    page.locator("select[name=units]").select_option("si")
    notes = re.compile(r'<span class="si-note".*?</span>')
    assert notes.sub("", page.locator("main").inner_html()) == before


def test_converted_numbers_are_those_of_the_definition_of_the_units(visit):
    seen = visit("point")
    si = seen.csv("parameters.1")
    seen.page.locator("select[name=units]").select_option("us")
    us = seen.csv("parameters.1")
    factors = {
        "N/(m/s)": 0.3048 / 4.4482216152605,
        "N/rad": 1 / 4.4482216152605,
        "N/(rad/s)": 1 / 4.4482216152605,
    }
    names = {"N/(m/s)": "lbf/(ft/s)", "N/rad": "lbf/rad", "N/(rad/s)": "lbf/(rad/s)"}
    seen_units = set()
    for one, other in zip(si[1:-1], us[1:-1], strict=True):
        unit = one[-1]
        assert other[-1] == names[unit]
        seen_units.add(unit)
        for column in (1, 2, 5, 6):  # estimate, standard error, interval
            assert float(other[column]) == pytest.approx(factors[unit] * float(one[column]), rel=1e-9)
        assert other[4] == one[4]  # t has no unit
    assert len(seen_units) == 3
    seen.page.locator("[id='parameters.1']").scroll_into_view_if_needed()
    for row in seen.page.locator("[id='parameters.1'] tbody tr").all()[:5]:  # what is read is that, rounded
        shown = row.locator("td").first
        text, exact = shown.inner_text().replace("−", "-"), shown.locator("data").get_attribute("value")
        unit = {v: k for k, v in names.items()}[row.locator("td").last.inner_text()]
        place = len(text.partition(".")[2])
        assert float(text) == pytest.approx(factors[unit] * float(exact), abs=0.51 * 10**-place)


def ticks(figure) -> list[float]:
    shown = figure.evaluate(
        "f => [...f.querySelectorAll('g.time .x text')].filter(t => t.getBoundingClientRect().width)"
        ".map(t => t.textContent)"
    )
    return [float(text.replace("−", "-")) for text in shown if re.fullmatch(r"[−\d.]+", text)]


def test_a_time_history_zooms_pans_and_comes_back(visit):
    page = visit("report").page
    figure = page.locator("figure:has(g.time):visible").first
    drawn = figure.locator("svg").inner_html()
    whole = ticks(figure)
    figure.get_by_role("button", name="Zoom in").click()
    near = ticks(figure)
    assert max(near) - min(near) < 0.75 * (max(whole) - min(whole))
    figure.get_by_role("button", name="Later").click()
    assert min(ticks(figure)) > min(near)
    figure.get_by_role("button", name="Whole span").click()
    assert figure.locator("svg").inner_html() == drawn
    # A stretch chosen with the mouse, from a quarter to a half of the panel.
    figure.scroll_into_view_if_needed()
    panel = figure.locator("svg").evaluate(
        "s => { const clip = s.querySelector('g.time [clip-path]').getAttribute('clip-path').slice(5, -1),"
        "r = document.getElementById(clip).firstElementChild, m = s.getScreenCTM(),"
        "v = n => Number(r.getAttribute(n));"
        "return [v('x') * m.a + m.e, v('y') * m.d + m.f, v('width') * m.a, v('height') * m.d]; }"
    )
    x, y, width, height = panel
    page.mouse.move(x + 0.25 * width, y + height / 2)
    page.mouse.down()
    page.mouse.move(x + 0.5 * width, y + height / 2, steps=5)
    page.mouse.up()
    start, end = map(float, figure.locator("g.time").first.get_attribute("data-span").split())
    chosen = ticks(figure)
    assert min(chosen) >= start + 0.23 * (end - start)
    assert max(chosen) <= start + 0.52 * (end - start)


def test_a_figure_is_enlarged_and_returns_to_its_place(visit):
    page = visit("report").page
    figure = page.locator("main figure:visible").nth(2)
    name, width = figure.get_attribute("id"), figure.locator("svg").bounding_box()["width"]
    figure.get_by_role("button", name="Enlarge").click()
    assert page.locator(f"dialog [id='{name}'] svg").bounding_box()["width"] > 1.2 * width
    page.keyboard.press("Escape")
    assert page.locator("main figure:visible").nth(2).get_attribute("id") == name


def test_a_saved_figure_is_an_svg_that_stands_alone(visit, tmp_path):
    page = visit("report", colours="dark").page
    figure = page.locator("main figure:visible").first
    with page.expect_download() as download:
        figure.get_by_role("button", name="Save as SVG").click()
    assert download.value.suggested_filename.endswith(".svg")
    saved = tmp_path / "figure.svg"
    download.value.save_as(saved)
    root = ElementTree.parse(saved).getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert root.get("width", "").endswith("pt")
    assert root[0].text == figure.locator("svg").get_attribute("aria-label")
    assert "var(" not in saved.read_text(encoding="utf-8")  # its colours are its own, for white paper


def test_every_number_of_a_table_has_an_address(visit):
    seen = visit("report")
    cell = seen.page.locator(f"[id='{seen.conditions}'] tbody td").nth(5)
    cell.click()
    address = seen.page.evaluate("location.hash")
    assert address.startswith(f"#{seen.conditions}/")
    assert "in full" in seen.page.get_by_role("status").inner_text()
    again = visit("report", at=address)
    assert again.page.locator("td.found").inner_text() == cell.inner_text()
    assert again.page.locator("td.found").is_visible()


def test_an_address_opens_the_details_that_hide_it(visit):
    hidden = visit("report").page.locator("details figure").last.get_attribute("id")
    there = visit("report", at=f"#{hidden}")
    assert there.page.locator(f"[id='{hidden}'] svg").is_visible()


def test_keys_alone_reach_contents_tables_and_figures(visit):
    page = visit("report").page
    reached = set()
    for _ in range(200):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.closest('nav, form, th, td, figure')?.tagName"))
        if {"NAV", "FORM", "TH", "TD", "FIGURE"} <= reached:
            break
        if page.evaluate("document.activeElement.matches('tbody th')"):
            page.keyboard.press("ArrowRight")
            page.keyboard.press("ArrowDown")
            page.keyboard.press("Enter")
            assert page.evaluate("document.activeElement.matches('td.found')")
            reached.add("TD")
            assert page.evaluate("document.activeElement.parentElement.rowIndex") >= 2
    assert {"NAV", "FORM", "TH", "TD", "FIGURE"} <= reached


@pytest.mark.parametrize("name", NAMES)
def test_print_holds_what_details_hide(visit, name):
    seen = visit(name)

    def sheets() -> int:
        return len(re.findall(rb"/Type\s*/Page\b", seen.page.pdf(prefer_css_page_size=True)))

    closed = sheets()
    assert seen.page.locator("main details:not([open])").count() > 0  # as it was before
    seen.open_all()
    assert sheets() == closed
    seen.page.evaluate("document.querySelectorAll('main details').forEach(part => part.remove())")
    assert sheets() < closed


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("width", [DESK, PHONE])
def test_figures_are_legible_and_nothing_overlaps_or_leaves_the_screen(visit, name, width):
    seen = visit(name, width)
    seen.open_all()
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
    sizes = seen.page.evaluate(TEXT_SIZES)
    assert len(sizes) > 100
    assert min(sizes)[0] >= LEAST_TEXT_PX, min(sizes)
    assert seen.page.evaluate(OVERLAPS) == []
    captions = seen.page.evaluate(
        "[...document.querySelectorAll('caption, figcaption')].map(c => c.getBoundingClientRect().right)"
    )
    assert max(captions) <= width


@pytest.mark.parametrize("width", [DESK, PHONE])
def test_captions_wrap_to_the_room_beside_a_scroll_bar(visit, width):
    seen = visit("report", width)
    seen.open_all()
    seen.page.evaluate("document.body.style.paddingRight = '15px'")  # headless, a scroll bar takes no room
    cut = seen.page.evaluate(
        f"[...document.querySelectorAll('.scroll caption')].filter(c => "
        f"c.getBoundingClientRect().right > {width - 15}).map(c => c.textContent.slice(0, 60))"
    )
    assert cut == []


def test_page_one_is_read_on_a_phone_without_a_sideways_scroll(visit):
    seen = visit("report", PHONE)
    seen.open_all()
    wide = seen.page.evaluate(
        "[...document.querySelectorAll('#verdict .scroll, #provenance .scroll')]"
        ".filter(box => box.scrollWidth > box.clientWidth + 1).map(box => box.innerText.slice(0, 60))"
    )
    assert wide == []
    card = seen.page.locator("#overturn + .scroll tbody tr").first
    assert card.locator("th").bounding_box()["width"] > 0.9 * (PHONE - 20)
    label = card.locator('td[data-label="Now"]').evaluate(
        "cell => getComputedStyle(cell, '::before').content"
    )
    assert "Now" in label


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("colours", ["light", "dark"])
def test_axe_finds_nothing_serious(visit, name, colours):
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright",
        reason="axe-playwright-python is not installed: `make browser-test`",
    )
    seen = visit(name, colours=colours)
    seen.open_all()
    found = axe.Axe().run(seen.page).response["violations"]
    serious = [
        f"{v['id']}: {v['nodes'][0]['html'][:150]}" for v in found if v["impact"] in ("serious", "critical")
    ]
    assert serious == []
