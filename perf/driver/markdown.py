"""Tables in Markdown."""


def table(titles: list[str], lines: list[list[str]]) -> str:
    head = ["| " + " | ".join(titles) + " |", "| " + " | ".join("---" for _ in titles) + " |"]
    return "\n".join(head + ["| " + " | ".join(line) + " |" for line in lines])
