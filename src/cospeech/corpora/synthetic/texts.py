"""What the synthetic speakers say: everyday sentences, rich in words that call for a gesture. Ours."""

__all__ = ["EVERYDAY", "SENTENCES", "TOPICS"]

EVERYDAY = (
    "Let me tell you about the day we moved into the new house.",
    "There were three rooms upstairs, two rooms downstairs, and one very small kitchen.",
    "I had never seen such a huge garden before, it went on and on.",
    "You know, everybody thought we would give up after a week.",
    "But no, absolutely not, we stayed, and I am glad that we did.",
    "First we painted the walls, second we mended the roof, and then we waited for spring.",
    "On the left there was an old tree, and over there, on the right, a tiny pond.",
    "My sister came to visit, and she brought all of her friends.",
    "We put the long table outside and ate together until it was dark.",
    "What did we talk about? Everything, really, from the weather to the stars.",
    "Some people say that money is what matters most, and I don't believe them.",
    "I think that time is the only thing that nobody can buy.",
    "Yesterday I was sure, today I am not, and tomorrow we shall see.",
    "The whole story is much bigger than that, so let us begin at the beginning.",
    "Imagine a long road that goes up and up, and then suddenly down to the sea.",
    "Between you and me, I was a little afraid of the first evening.",
    "Nothing happened, of course, nothing at all.",
    "The teacher looked at us and said, you can do this, all of you.",
    "It takes five minutes, maybe ten, and it costs almost nothing.",
    "On the one hand it is quick, on the other hand it is never exact.",
    "So we drew a circle around the town and measured everything inside it.",
    "The numbers went up in the first year, and they fell in the second.",
    "Why would anybody do that? I have asked myself many times.",
    "Here is the important part, so please listen to me now.",
    "We need to work together, or we will not get anywhere.",
    "It was so small that you could hold it between two fingers.",
    "And then the door opened wide, and the whole crowd came in at once.",
    "Stop, I said, wait, there is something that you should know.",
    "That was a long time ago, of course, and much has changed since then.",
    "In the end we all laughed, and nobody remembered who had started it.",
    "My grandfather used to say that a good question is worth four answers.",
    "I would rather walk ten miles in the rain than sit in that room again.",
    "He pushed, she pulled, and between them the box moved a few inches.",
    "Look, it is really very simple, you take this one away and put that one there.",
    "Maybe you are right, I honestly don't know.",
    "Thank you, all of you, for coming here tonight.",
)

# who | a thing | where | did | do | a number of things | how it was | what came of it
_TOPICS = """
my neighbour | a wooden boat | behind the barn | sanded | sand it down | four planks | rough | it floats
the baker | a tall oven | in the cellar | repaired | mend the door | nine loaves | hot | the bread rose
our doctor | a heavy microscope | on the top shelf | cleaned | clean the lens | two slides | blurred | we saw cells
the young pilot | a yellow glider | above the valley | steered | turn it round | six hills | windy | she landed well
my uncle | an empty beehive | under the apple trees | carried | carry it home | ten jars | sticky | we had honey
the librarian | a forgotten atlas | between the shelves | found | bind it again | three maps | dusty | it was priceless
a fisherman | a torn net | along the harbour | knotted | knot the ropes | eight crabs | wet | he sold them all
the architect | a glass tower | beside the station | designed | draw the stairs | seven floors | bright | it won a prize
our coach | a deflated ball | on the far field | pumped | pump it up | five players | muddy | we won the match
the violinist | an old bow | on the bare stage | tightened | play it softly | twelve bars | quiet | they all stood up
my cousin | a tiny robot | across the kitchen table | wired | make it walk | two motors | clumsy | it danced
the gardener | a broken fountain | in the middle of the park | drained | dig a trench | six pipes | deep | water came
a tailor | a silk jacket | near the window | measured | cut the sleeves | three buttons | narrow | it fits me now
the astronomer | a faint comet | over the roofs | followed | wait for midnight | one tail | cold | we saw it twice
my daughter | a paper kite | high over the beach | painted | let it fly | four strings | wild | it never came down
the cook | a copper pan | at the back of the stove | polished | stir it slowly | five onions | sharp | everyone cried
our mayor | a wide bridge | at the edge of town | opened | cross it slowly | two rivers | slippery | traffic halved
the mechanic | a rusty engine | inside the garage | dismantled | start it again | eight bolts | loud | it runs for ever
a sculptor | a block of marble | outside the museum | chiselled | shape the hands | ten fingers | smooth | it looks alive
the nurse | a folded letter | under the pillow | unfolded | read it aloud | three lines | gentle | he smiled at last
"""
_FRAMES = (
    "Let me show you how {who} {did} {thing} {where}.",
    "First I saw {thing}, and then, {where}, there was something even better.",
    "You have to {do}, or nothing will ever come of it.",
    "It was really {how}, much too {how}, and I told {who} so.",
    "There were {number}, not one more, and {who} counted them again and again.",
    "And in the end, can you believe it, {end}.",
    "Who would put {thing} {where}?",
    "Nobody but {who} could {do} in a single afternoon.",
    "On one side stood {who}, on the other side {thing}, and I stood in between.",
    "No, I would never {do} all by myself.",
    "If you go {where}, look up, and you will find {thing}.",
    "I asked {who} three times, and each time the answer was, {do}.",
    "It was so {how} that we could hardly hold it, and still, {end}.",
    "With {number} and a little patience, {who} {did} {thing}.",
    "Yesterday {who} said to all of us, please, {do}.",
    "Some of it was small, some of it huge, and all of it lay {where}.",
    "What matters is this: {end}, and that is thanks to {who}.",
    "I can tell you exactly how {how} it felt when {who} {did} {thing}.",
    "Maybe we need {number}, maybe we need none.",
    "The day before, nobody knew about {thing}, and now the whole town talks about it.",
)


def _tell(topic: str) -> tuple[str, ...]:
    """What is said about a topic."""
    parts = dict(zip(("who", "thing", "where", "did", "do", "number", "how", "end"), topic.split(" | "), strict=True))
    sentences = (frame.format(**parts) for frame in _FRAMES)
    return tuple(text[0].upper() + text[1:] for text in sentences)


TOPICS: tuple[tuple[str, ...], ...] = tuple(_tell(topic) for topic in _TOPICS.strip().splitlines())
"""Twenty sentences about each of twenty things; a topic is of one split, so that its words tell nothing of another one."""
SENTENCES = (*EVERYDAY, *(text for topic in TOPICS for text in topic))
"""All: 436."""
