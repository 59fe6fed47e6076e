; The rounding shifts of the fixed-point runtime (libc/gtc_num_q31.h), for every argument; statement by statement.
; `unsat` says that no argument breaks the claim. Integers are taken in 128 bits, where nothing overflows.
(set-logic QF_BV)
(define-sort word () (_ BitVec 64))
(define-sort wide () (_ BitVec 128))
(declare-const x word)
(declare-const n word)
(define-fun widened ((a word)) wide ((_ sign_extend 64) a))

; gtc_q31_floored(x, n)
(define-fun magnitude () word (ite (bvsge x #x0000000000000000) x (bvsub (bvneg #x0000000000000001) x)))
(define-fun whole () word (bvlshr magnitude n))
(define-fun floored () word (ite (bvsge x #x0000000000000000) whole (bvsub (bvneg #x0000000000000001) whole)))

; gtc_q31_units(x): two's complement of the result, 32 bits
(define-fun units () (_ BitVec 32) ((_ extract 31 0) (bvlshr x #x000000000000001d)))

; q = floor(x / 2^n) says q 2^n <= x < (q + 1) 2^n
(define-fun is_floor ((q word) (bits word)) Bool
  (let ((step (bvshl #x00000000000000000000000000000001 ((_ zero_extend 64) bits))))
    (let ((below (bvmul (widened q) step)))
      (and (bvsle below (widened x)) (bvslt (widened x) (bvadd below step))))))

(push)
(assert (bvult n #x000000000000003f)) ; 0 ... 62
(assert (not (is_floor floored n)))
(check-sat)
(pop)
(push)
; |sum| < 2^60, so its units fit in 32 bits
(assert (bvsge x (bvneg #x1000000000000000)))
(assert (bvslt x #x1000000000000000))
(assert (not (is_floor ((_ sign_extend 32) units) #x000000000000001d)))
(check-sat)
(pop)
