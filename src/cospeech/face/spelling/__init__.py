"""How languages are spelt, as far as the lips show it: tables of rules for languages, and for families of them.

The rules are ours, written from the spelling rules of each language. They tell apart what looks different on a mouth: closed
lips (b, p, m), a bitten lip (f, v), rounded lips (o, u, w, ö, ü), spread ones (i, e), an open jaw (a).
"""
