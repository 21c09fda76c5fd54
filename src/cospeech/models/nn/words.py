"""Words as numbers in a network: the mean of learnt rows of a table of subwords, or vectors as they are."""

from __future__ import annotations

from torch import Tensor, nn

from ...audio.features.words import BUCKETS

__all__ = ["SubwordTable", "WordEmbedding", "word_embedding"]


class SubwordTable(nn.Module):
    """(B, T, GRAMS) ids, 0: none → (B, T, width): the mean of the rows of a word's ids, zeros where there is no word.

    Args:
        width: of a row.
        buckets: ids.
    """

    def __init__(self, width: int, buckets: int = BUCKETS) -> None:
        super().__init__()
        self.width, self.table = width, nn.Embedding(buckets + 1, width, padding_idx=0)

    def forward(self, ids: Tensor) -> Tensor:
        count = (ids > 0).sum(-1, keepdim=True).clamp_min(1)
        vectors: Tensor = self.table(ids).sum(-2) / count
        return vectors


class WordEmbedding(nn.Module):
    """(B, T, width) vectors learnt elsewhere, as they are."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.width = width

    def forward(self, vectors: Tensor) -> Tensor:
        return vectors


def word_embedding(text: int, width: int) -> SubwordTable | WordEmbedding:
    """The embedding of the words of a store.

    Args:
        text: width of the store's word vectors; 0: it has ids of subwords.
        width: of a word, where the network learns it.
    """
    return WordEmbedding(text) if text else SubwordTable(width)
