/* Sparse systems of any kind: factors P A Q = L U with partial pivoting, column by column.
 *
 * The pattern of a column of the factors is what its entries reach in the columns before (Gilbert and Peierls 1988;
 * Davis 2006, chapter 6).  Of pivots the one on the diagonal is taken where it is not small beside the others, which
 * keeps the factors sparse.  Included by factors.c.
 */

#define SF_SMALL 0.1 /* share of the largest in a column that a pivot on the diagonal must have */
#define SF_SERVES 1e-3 /* the same of a pivot that was chosen for another matrix */

/* Places that the entries of a column reach, in topological order from top on. */
static int sf_reach(sf_pivoted *f, int column, int mark) {
  int top = f->n, p, *stack = f->stack, *at = f->at;
  for (p = f->start[column]; p < f->start[column + 1]; ++p) {
    int head = 0;
    if (f->mark[f->row[p]] == mark) continue;
    stack[0] = f->row[p];
    while (head >= 0) {
      int i = stack[head], k = f->place[i], next, end, found = 0;
      if (f->mark[i] != mark) {
        f->mark[i] = mark;
        at[head] = k < 0 ? 0 : f->lower[k];
      }
      end = k < 0 ? 0 : f->lower[k + 1];
      for (next = at[head]; next < end; ++next) {
        int j = f->lower_row[next];
        if (f->mark[j] == mark) continue;
        at[head] = next + 1;
        stack[++head] = j;
        found = 1;
        break;
      }
      if (!found) {
        --head;
        f->reached[--top] = i;
      }
    }
  }
  return top;
}

/* Factors of a matrix; 1 where it is singular, 2 where they have no room. */
static int sf_pivot(sf_pivoted *f, const double *entries) {
  int n = f->n, k, i, p, lower = 0, upper = 0;
  f->known = 0;
  for (i = 0; i < n; ++i) {
    f->place[i] = -1;
    f->mark[i] = -1;
    f->x[i] = 0.0;
  }
  for (k = 0; k < n; ++k) {
    int column = f->order[k], top, chosen = -1;
    double most = -1.0;
    f->lower[k] = lower;
    f->upper[k] = upper;
    if (lower + n > f->room || upper + n > f->room) return 2;
    top = sf_reach(f, column, k);
    for (p = f->start[column]; p < f->start[column + 1]; ++p) f->x[f->row[p]] += entries[p];
    for (p = top; p < n; ++p) {
      int j = f->reached[p], at = f->place[j], q;
      double value;
      if (at < 0) continue;
      value = f->x[j];
      for (q = f->lower[at]; q < f->lower[at + 1]; ++q) f->x[f->lower_row[q]] -= f->lower_value[q] * value;
    }
    for (p = top; p < n; ++p) {
      i = f->reached[p];
      if (f->place[i] >= 0) {
        f->upper_row[upper] = f->place[i];
        f->upper_value[upper++] = f->x[i];
      } else if (fabs(f->x[i]) > most) {
        most = fabs(f->x[i]);
        chosen = i;
      }
    }
    if (chosen < 0 || !(most > 0.0)) return 1;
    if (f->mark[column] == k && f->place[column] < 0 && fabs(f->x[column]) >= SF_SMALL * most) chosen = column;
    f->pivot[k] = f->x[chosen];
    f->place[chosen] = k;
    f->row_of[k] = chosen;
    for (p = top; p < n; ++p) {
      i = f->reached[p];
      if (f->place[i] < 0) {
        f->lower_row[lower] = i;
        f->lower_value[lower++] = f->x[i] / f->pivot[k];
      }
      f->x[i] = 0.0;
    }
    f->lower[k + 1] = lower;
    f->upper[k + 1] = upper;
  }
  f->known = 1;
  return 0;
}

/* Factors of another matrix with the pivots of the last one, whose patterns are the same; 1 where one has become small.
 *
 * Whoever asks looks at what the solution leaves over, and chooses pivots anew where that is much.
 */
static int sf_pivot_again(sf_pivoted *f, const double *entries) {
  int n = f->n, k, p, q;
  double *x = f->x;
  if (!f->known) return 1;
  for (k = 0; k < n; ++k) {
    int column = f->order[k];
    double pivot, most;
    for (p = f->start[column]; p < f->start[column + 1]; ++p) x[f->row[p]] += entries[p];
    /* Places are in an order in which each is final before its column acts on the others. */
    for (p = f->upper[k]; p < f->upper[k + 1]; ++p) {
      int at = f->upper_row[p], from = f->row_of[at];
      double value = x[from];
      x[from] = 0.0;
      f->upper_value[p] = value;
      for (q = f->lower[at]; q < f->lower[at + 1]; ++q) x[f->lower_row[q]] -= f->lower_value[q] * value;
    }
    pivot = x[f->row_of[k]];
    x[f->row_of[k]] = 0.0;
    most = fabs(pivot);
    for (p = f->lower[k]; p < f->lower[k + 1]; ++p) {
      int i = f->lower_row[p];
      double value = x[i];
      x[i] = 0.0;
      if (!(fabs(value) <= most)) most = fabs(value);
      f->lower_value[p] = value / pivot;
    }
    if (!(fabs(pivot) > SF_SERVES * most)) return 1;
    f->pivot[k] = pivot;
  }
  return 0;
}

/* Which pivots factors have, and their patterns, in six parts. */
static int *sf_part_of_pivots(const sf_pivoted *f, int part) {
  int *const parts[] = {f->place, f->row_of, f->lower, f->upper, f->lower_row, f->upper_row};
  return parts[part];
}

static int sf_size_of_part(const sf_pivoted *f, int part) {
  return part < 2 ? f->n : part < 4 ? f->n + 1 : part < 5 ? f->lower[f->n] : f->upper[f->n];
}

/* Which pivots the last factors have, and their patterns, one after the other: the number of these numbers; 0 where no
 * matrix was factorised.  pivots: NULL, or so many.
 */
int sf_pivots(const sf_pivoted *f, int *pivots) {
  int part, k, count = 0;
  if (!f->known) return 0;
  for (part = 0; part < 6; ++part) {
    const int *from = sf_part_of_pivots(f, part);
    for (k = 0; k < sf_size_of_part(f, part); ++k, ++count)
      if (pivots) pivots[count] = from[k];
  }
  return count;
}

/* Take these pivots for the next matrix. */
static void sf_take_pivots(sf_pivoted *f, const int *pivots) {
  int part, k;
  for (part = 0; part < 6; ++part) {
    int *to = sf_part_of_pivots(f, part);
    /* How long the last two are stands in those before. */
    for (k = 0; k < sf_size_of_part(f, part); ++k) to[k] = *pivots++;
  }
  for (k = 0; k < f->n; ++k) f->x[k] = 0.0;
  f->known = 1;
}

/* The solution in place of a right side. */
static void sf_pivoted_backward(const sf_pivoted *f, double *x, double *work) {
  int n = f->n, k, p;
  /* L has the rows of the matrix. */
  for (k = 0; k < n; ++k) {
    double value = x[f->row_of[k]];
    work[k] = value;
    for (p = f->lower[k]; p < f->lower[k + 1]; ++p) x[f->lower_row[p]] -= f->lower_value[p] * value;
  }
  for (k = n - 1; k >= 0; --k) {
    work[k] /= f->pivot[k];
    for (p = f->upper[k]; p < f->upper[k + 1]; ++p) work[f->upper_row[p]] -= f->upper_value[p] * work[k];
  }
  for (k = 0; k < n; ++k) x[f->order[k]] = work[k];
}
